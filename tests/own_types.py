"""Five machines that Pogon does not know, as an integrator would describe them, and plants of them on any carrier."""

from pathlib import Path

VALVE = {
    "device": """
label = "type"
area = "water"
tile = ["position", "opened"]
[device]
read_functions = [1, 2, 4]
write_functions = [5]
fast = 0.1
[options.stroke]
default = 4
low = 1
high = 60
""",
    "points": """
[open]
table = "coil"
address = 0
writable = true
texts = [0, 1]
[close]
table = "coil"
address = 1
writable = true
texts = [0, 1]
[opened]
address = "10001"
texts = [0, 1]
[closed]
address = "10002"
texts = [0, 1]
[position]
address = "30001"
scale = 0.1
unit = "%"
decimals = 1
low = 0
high = 100
""",
    "commands": """
[open]
writes = [{ point = "open", value = 1 }]
feedback = "opened == 1"
timeout = 10
[close]
writes = [{ point = "close", value = 1 }]
feedback = "closed == 1"
timeout = 10
[stop]
writes = [{ point = "open", value = 0 }, { point = "close", value = 0 }]
feedback = "open == 0 and close == 0"
level = "C0"
stop = true
moves = false
""",
    "simulation": """
[start]
closed = 1
[[writes]]
point = "open"
value = 1
set = { close = 0 }
[[writes]]
point = "close"
value = 1
set = { open = 0 }
[values.position]
to = "100 * open + position * (open == close)"
rate = "100 / stroke"
[[rules]]
when = "position >= 100"
set = { opened = 1, open = 0 }
[[rules]]
when = "position < 99.9"
set = { opened = 0 }
[[rules]]
when = "position <= 0"
set = { closed = 1, close = 0 }
[[rules]]
when = "position > 0.1"
set = { closed = 0 }
""",
    "texts.en": """
type = "Valve"
area = "Water"
[point]
open = "Opening"
close = "Closing"
opened = "Open"
closed = "Closed"
position = "Position"
[choice]
open.0 = "no"
open.1 = "yes"
close.0 = "no"
close.1 = "yes"
opened.0 = "no"
opened.1 = "yes"
closed.0 = "no"
closed.1 = "yes"
[command]
open = "Open"
close = "Close"
stop = "Stop"
""",
}
METER = {
    "device": """
label = "type"
area = "energy"
tile = ["power", "energy"]
[device]
max_read = 20
max_write = 4
write_functions = [6, 16]
fast = 0.2
[options.rated_power]
default = 10
low = 1
high = 100
""",
    "points": """
[power]
address = 10
type = "f64"
order = "cdab"
unit = "kW"
decimals = 3
low = -1
high = "2 * rated_power"
[energy]
address = 14
type = "u64"
order = "cdab"
scale = 0.001
unit = "kWh"
decimals = 3
[state]
address = 18
kind = "enum"
texts = [0, 1]
[life]
address = 19
kind = "step"
[switch]
address = 20
kind = "step"
readable = false
writable = true
history = false
""",
    "setpoints": """
[limit]
address = 21
type = "f32"
order = "badc"
unit = "kW"
decimals = 1
low = 1
high = 100
role = "operator"
""",
    "commands": """
[on]
writes = [{ point = "switch", value = 1 }]
feedback = "state == 1"
timeout = 3
[off]
writes = [{ point = "switch", value = 0 }]
feedback = "state == 0"
timeout = 3
level = "C0"
stop = true
moves = false
""",
    "simulation": """
[start]
limit = 50
energy = "1000 * rated_power"
[[writes]]
point = "switch"
value = 1
when = "fault == 0"
refuse = 4
set = { state = 1 }
[[writes]]
point = "switch"
value = 0
set = { state = 0 }
[[rules]]
when = "fault == 7"
set = { state = 0 }
[values.power]
to = "min(0.8 * rated_power, limit) * state"
lag = 2
noise = 0.01
[values.energy]
integral = "power / 3600"
[values.life]
every = 0.5
modulo = 1000
""",
    "training": """
live = ["state", "power"]
[faults]
fuse = 7
""",
    "texts.en": """
type = "Energy meter"
area = "Energy"
[point]
power = "Power"
energy = "Energy"
state = "State"
life = "Life"
switch = "Switch"
limit = "Limit"
[choice.state]
0 = "off"
1 = "on"
[command]
on = "Switch on"
off = "Switch off"
[training.fault]
7 = "Fuse"
""",
}
SCALE = {
    "device": """
label = "type"
area = "scales"
tile = ["weight"]
[device]
max_write = 2
write_functions = [6, 16, 22]
fast = 0.2
holes = [[8, 9]]
""",
    "points": """
[weight]
address = 0
type = "i32"
scale = 0.001
unit = "kg"
decimals = 3
[status]
address = 2
kind = "step"
[stable]
part_of = "status"
shift = 0
mask = 1
kind = "enum"
texts = [0, 1]
[zeroed]
part_of = "status"
shift = 15
mask = 1
kind = "enum"
texts = [0, 1]
[command]
address = 4
kind = "step"
writable = true
[damping]
address = 5
mask = 15
shift = 4
kind = "step"
writable = true
[turns]
address = 5
mask = 15
kind = "step"
[name]
address = 10
type = "string"
words = 4
kind = "text"
history = false
""",
    "setpoints": """
[load]
address = 6
type = "i32"
scale = 0.001
unit = "kg"
decimals = 3
low = -50
high = 50
role = "operator"
""",
    "commands": """
[zero]
writes = [{ point = "command", value = 1 }]
feedback = "zeroed == 1"
timeout = 3
moves = false
[damp]
writes = [{ point = "damping", value = 9 }]
feedback = "damping == 9"
moves = false
[set_load]
writes = [{ point = "load", value = "argument" }]
feedback = "abs(load - argument) < 0.0006"
argument = "load"
moves = false
""",
    "simulation": """
[start]
name = "W-1"
load = 12.5
status = 1
damping = 2
turns = 5
[values.weight]
to = "load * (zeroed == 0)"
lag = 0.5
[[writes]]
point = "command"
value = 1
set = { zeroed = 1, command = 0 }
[[writes]]
point = "load"
set = { stable = 0, zeroed = 0 }
[[rules]]
when = "abs(weight - load) < 0.01"
after = 0.3
set = { stable = 1 }
""",
    "texts.en": """
type = "Scale"
area = "Scales"
[point]
weight = "Weight"
status = "Status"
stable = "Stable"
zeroed = "Zeroed"
command = "Command"
damping = "Damping"
turns = "Turns"
name = "Name"
load = "Load"
[choice]
stable.0 = "no"
stable.1 = "yes"
zeroed.0 = "no"
zeroed.1 = "yes"
[command]
zero = "Zero"
damp = "Damp"
set_load = "Set load"
""",
}
PUMPS = {
    "device": """
label = "type"
area = "water"
tile = ["level", "state_{pump}"]
[device]
max_read = 40
fast = 0.2
[options.pumps]
default = 2
low = 1
high = 6
whole = true
[repeats]
pump = { to = "pumps" }
""",
    "points": """
[level]
address = 0
type = "f32"
unit = "m"
decimals = 2
low = 0
high = 6
["state_{pump}"]
address = { by = [[1, 10, 1]] }
kind = "enum"
texts = [0, 1, 2]
["command_{pump}"]
address = { by = [[1, 20, 1]] }
kind = "step"
writable = true
readable = false
history = false
""",
    "commands": """
["start_{pump}"]
writes = [{ point = "command_{pump}", value = 1 }]
feedback = "state_{pump} == 2"
timeout = 5
["halt_{pump}"]
writes = [{ point = "command_{pump}", value = 2 }]
feedback = "state_{pump} == 0"
timeout = 5
moves = false
""",
    "simulation": """
[start]
level = 3
[values.level]
integral = "0.02 - 0.05 * (state_1 == 2)"
low = 0
high = 6
[[writes]]
each = ["pump"]
point = "command_{pump}"
value = 1
when = "state_{pump} != 2"
set = { "state_{pump}" = 1 }
[[writes]]
each = ["pump"]
point = "command_{pump}"
value = 2
set = { "state_{pump}" = 0 }
[[rules]]
each = ["pump"]
when = "state_{pump} == 1"
after = 1.5
set = { "state_{pump}" = 2 }
""",
    "texts.en": """
type = "Pump group"
area = "Water"
[point]
level = "Level"
"state_{pump}" = "State of pump {pump}"
"command_{pump}" = "Command of pump {pump}"
[choice."state_{pump}"]
0 = "stopped"
1 = "starting"
2 = "running"
[command]
"start_{pump}" = "Start pump {pump}"
"halt_{pump}" = "Stop pump {pump}"
""",
}
LOGGER = {
    "device": """
label = "type"
area = "water"
tile = ["flow"]
[device]
read_functions = [4]
write_functions = []
max_read = 16
""",
    "points": """
[flow]
address = "30001"
type = "f32"
order = "dcba"
unit = "l/s"
decimals = 2
[temperature]
address = "30003"
type = "i16"
none = 0x8000
scale = 0.1
unit = "°C"
decimals = 1
[life]
address = "30010"
kind = "step"
""",
    "simulation": """
[start]
temperature = -12.5
[values.flow]
to = 3
rate = 0.5
[values.life]
every = 1
""",
    "texts.en": """
type = "Logger"
area = "Water"
[point]
flow = "Flow"
temperature = "Temperature"
life = "Life"
""",
}
TYPES = {"valve": VALVE, "meter": METER, "scale": SCALE, "pumps": PUMPS, "logger": LOGGER}
HEAD = """
[plant]
name = "Works"
timezone = "Europe/Zagreb"
languages = ["en"]
[links.line]
"""
MACHINES = """
[equipment.v1]
type = "valve"
link = "line"
unit = 1
[equipment.e1]
type = "meter"
link = "line"
unit = 2
rated_power = 12
[equipment.w1]
type = "scale"
link = "line"
unit = 3
[equipment.w2]
type = "scale"
link = "line"
unit = 3
base = 100
[equipment.w3]
type = "scale"
link = "line"
unit = 3
base = 200
[equipment.p1]
type = "pumps"
link = "line"
unit = 4
pumps = 3
[equipment.l1]
type = "logger"
link = "line"
unit = 5
"""
CARRIERS = {
    "memory": 'transport = "memory"\n',
    "tcp": 'transport = "tcp"\nhost = "127.0.0.1"\nport = {port}\nwrites = true\nsimulated = true\n',
    "rtu": 'transport = "rtu"\nport = "{port}"\nbaud = 115200\nparity = "none"\nwrites = true\nsimulated = true\n',
}


def write_own(folder: Path, carrier: str = "memory", port: object = 1502, machines: str = MACHINES) -> Path:
    """A plant folder with the five types, its machines on one link of `carrier`."""
    for name, files in TYPES.items():
        own = folder / "equipment" / name
        own.mkdir(parents=True, exist_ok=True)
        for file, text in files.items():
            (own / f"{file}.toml").write_text(text, "utf-8")
    text = HEAD + CARRIERS[carrier].format(port=port) + machines
    (folder / "plant.toml").write_text(text, "utf-8")
    return folder
