"""Records, and what products, runs and forces were until now as such, with their events.

An event of a product was kept with each product that it was about, one of a run with the run, a force had a row of its own: here each
event is one row, and belongs to its records. The old tables stay; nothing reads them any more.
"""

import json
import math
import struct

import sqlalchemy as sa
from alembic import op

revision = "0006"
down_revision = "0005"
branch_labels = None
depends_on = None

BITS, NO_BIT = 16, 0xFFFF
FORCED, LOST, BACK = 15, 9, 10
CAUSES = ("", "abort_condition", "permissive_lost", "operator", "time", "stall", "power_up")
AT_ONCE = 5000


def upgrade() -> None:
    _create()
    connection = op.get_bind()
    for table in ("passage", "sequence_run", "sequence_force"):
        connection.exec_driver_sql(
            f"INSERT INTO event_machine (lasting_id, name) SELECT DISTINCT equipment, equipment FROM {table} "
            "WHERE equipment NOT IN (SELECT name FROM event_machine) AND equipment NOT IN (SELECT lasting_id FROM event_machine)"
        )
        connection.exec_driver_sql(  # its lasting id is another one's now, which nobody can be that has rows here
            f"INSERT INTO event_machine (lasting_id, name) SELECT DISTINCT '→' || equipment, equipment FROM {table} "
            "WHERE equipment NOT IN (SELECT name FROM event_machine)"
        )
    connection.exec_driver_sql("INSERT OR IGNORE INTO definition (id, text) SELECT id, text FROM sequence_definition")
    machines = dict(connection.exec_driver_sql("SELECT name, id FROM event_machine").all())
    events = _Events(connection)
    _passages(connection, machines, events)
    _runs(connection, machines, events)
    _forces(connection, machines, events)


def downgrade() -> None:
    for name in ("definition", "record_event", "record_part", "record"):
        op.drop_table(name)


class _Events:
    """The rows of `event`: each once, by machine, boot, sequence and time."""

    def __init__(self, connection):
        self._connection = connection
        self._known = {
            (machine, boot, sequence, time): id
            for id, machine, boot, sequence, time in connection.exec_driver_sql(
                "SELECT id, machine, boot, sequence, time FROM event"
            )
        }
        self._next = max(self._known.values(), default=0) + 1
        self._new = []

    def of(self, machine, boot, sequence, time, code, source, value, words, person, reason):
        """Its number; a new row where there is none."""
        key = (machine, boot, sequence, time)
        number = self._known.get(key)
        if number is None:
            number = self._known[key] = self._next
            self._next += 1
            self._new.append((number, machine, boot, sequence, time, code, source, value, words, person, reason))
        elif person:
            self.write()
            self._connection.exec_driver_sql(
                "UPDATE event SET person = ?, reason = ? WHERE id = ? AND person = ''", (person, reason, number)
            )
        if len(self._new) >= AT_ONCE:
            self.write()
        return number

    def write(self):
        if self._new:
            self._connection.exec_driver_sql(
                "INSERT INTO event (id, machine, boot, sequence, time, code, source, value, words, request, person, reason) "
                "VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, 0, ?, ?)",
                self._new,
            )
            self._new = []


def _passages(connection, machines, events):
    """In the order in which they happened: of an event with two products the one behind, which entered later, is told first."""
    for row in connection.exec_driver_sql("SELECT * FROM passage ORDER BY id").mappings():
        fields = {"corrections": row["corrections"]}
        fields |= {name: row[name] for name in ("length", "greatest") if row[name] is not None}
        first = _first(connection, row["id"])
        seconds = _seconds(row["entered"], row["ended"])
        connection.exec_driver_sql(
            _INSERT,
            (
                row["id"], machines[row["equipment"]], "passage", row["product"], row["boot"], first, row["entered"],
                row["entry"], row["outcome"], row["ended"], seconds, 0, None, row["missed"], row["alarms"],
                "", "", row["greatest"], json.dumps(fields), "",
            ),
        )  # fmt: skip
    rows = connection.exec_driver_sql(
        "SELECT s.*, p.product, p.equipment FROM passage_step s JOIN passage p ON p.id = s.passage "
        "ORDER BY s.time, p.equipment, s.boot, s.sequence, p.entered DESC, p.id DESC"
    ).mappings()
    belonging = []
    for row in rows.all():
        words = _words(">IIf", row["product"], row["second"], _number(row["second_value"]))
        number = events.of(
            machines[row["equipment"]], row["boot"], row["sequence"], row["time"], row["code"], row["source"], row["value"], words,
            row["person"], row["reason"],
        )  # fmt: skip
        belonging.append((row["passage"], number))
    events.write()
    _belong(connection, belonging)


def _runs(connection, machines, events):
    numbers = {}
    rows = connection.exec_driver_sql("SELECT * FROM sequence_run ORDER BY id").mappings().all()
    fallen = _fallen(connection)
    for row in rows:
        fields = {name: row[name] for name in ("step", "suspensions", "stalls", "losses", "forces", "first_together")}
        if row["cause"]:
            fields["cause"] = CAUSES[row["cause"]]
        if row["first_out"]:
            fields |= {
                name: row[name] for name in ("first_out", "first_step", "first_bit", "first_time", "first_value")
            }
        if row["acknowledged"] is not None:
            fields["acknowledged"] = row["acknowledged"]
        memo = fallen.get(row["id"], {}) if row["outcome"] == "open" else {}
        numbers[row["id"]] = connection.exec_driver_sql(
            _INSERT,
            (
                None, machines[row["equipment"]], "run", 0, row["boot"], row["sequence"], row["started"], row["seen"], row["outcome"],
                row["ended"], row["seconds"], row["suspended"], row["suspended_at"], row["missed"], "", row["definition"],
                row["first_out"], None, json.dumps(fields), json.dumps(memo) if memo else "",
            ),
        ).scalar_one()  # fmt: skip
    for row in connection.exec_driver_sql("SELECT * FROM sequence_step").mappings().all():
        if row["run"] in numbers:
            connection.exec_driver_sql(
                "INSERT INTO record_part (record, number, key, state, begun, ended, seconds, paused) VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
                (
                    numbers[row["run"]], row["step"], row["key"], row["state"], row["entered"], row["ended"], row["seconds"],
                    row["suspended"],
                ),
            )  # fmt: skip
    belonging = []
    told = connection.exec_driver_sql(
        "SELECT e.*, r.equipment FROM sequence_event e JOIN sequence_run r ON r.id = e.run ORDER BY e.time, r.equipment, e.boot, e.sequence"
    ).mappings()
    for row in told.all():
        bit = NO_BIT if row["bit"] is None else row["bit"]
        words = _words(">HHHHf", bit, row["together"], row["abort_word"], row["step_word"], _number(row["signal"]))
        number = events.of(
            machines[row["equipment"]], row["boot"], row["sequence"], row["time"], row["code"], row["step"], row["value"], words,
            row["person"], row["reason"],
        )  # fmt: skip
        belonging.append((numbers[row["run"]], number))
    events.write()
    _belong(connection, belonging)


def _fallen(connection):
    """Run under way → place of a permissive → when it was last told as lost, and the value behind it, unless it came back."""
    found = {}
    rows = connection.exec_driver_sql(
        "SELECT e.run, e.code, e.step, e.bit, e.time, e.signal FROM sequence_event e JOIN sequence_run r ON r.id = e.run "
        f"WHERE r.outcome = 'open' AND e.code IN ({LOST}, {BACK}) AND e.bit IS NOT NULL ORDER BY e.time, e.boot, e.sequence"
    )
    for run, code, step, bit, time, signal in rows.all():
        places = found.setdefault(run, {})
        if code == LOST:
            places[f"{step}.{bit}"] = [time, signal]
        else:
            places.pop(f"{step}.{bit}", None)
    return found


def _forces(connection, machines, events):
    rows = connection.exec_driver_sql(
        "SELECT f.*, d.text FROM sequence_force f LEFT JOIN sequence_definition d ON d.id = f.definition "
        "ORDER BY f.since, f.equipment, f.boot, f.sequence"
    ).mappings()
    rows = rows.all()
    newest = {(row["equipment"], row["step"], row["bit"]): index for index, row in enumerate(rows)}
    belonging = []
    for index, row in enumerate(rows):
        last = newest[row["equipment"], row["step"], row["bit"]] == index
        fields = {"asked": row["asked"], "permissive": _permissive(row["text"], row["step"], row["bit"])}
        outcome = row["ending"] or ("open" if last else "over")
        seconds = _seconds(row["since"], row["until"] if row["ending"] else None)
        record = connection.exec_driver_sql(
            _INSERT,
            (
                None, machines[row["equipment"]], "force", row["step"] * BITS + row["bit"], row["boot"], row["sequence"], row["since"],
                FORCED, outcome, row["until"], seconds,
                0, None, 0, "", row["definition"], "", None, json.dumps(fields), "",
            ),
        ).scalar_one()  # fmt: skip
        words = _words(">HHHHf", row["bit"], 0, 0, 0, math.nan)
        number = events.of(
            machines[row["equipment"]], row["boot"], row["sequence"], row["since"], FORCED, row["step"], row["asked"], words, row["person"],
            row["reason"],
        )  # fmt: skip
        belonging.append((record, number))
    events.write()
    _belong(connection, belonging)


def _permissive(text, step, bit):
    content = json.loads(text or "{}")
    steps = content.get("steps", [])
    known = 0 < step <= len(steps)
    word = "abort" if step == 0 else steps[step - 1]["key"] if known else str(step)
    named = content.get("abort", []) if step == 0 else steps[step - 1]["permissives"] if known else []
    return f"{word}.{next((each['key'] for each in named if each['bit'] == bit), f'bit_{bit}')}"


def _first(connection, passage):
    found = connection.exec_driver_sql(
        "SELECT sequence FROM passage_step WHERE passage = ? ORDER BY time, boot, sequence LIMIT 1", (passage,)
    ).scalar()
    return found or 0


def _seconds(begun, ended):
    return None if ended is None else (ended - begun) / 1e6


def _number(value):
    return math.nan if value is None else value


def _words(layout, *values):
    """Snapshot words as they are kept: big-endian, zero words at the end left out."""
    packed = struct.pack(layout, *values)
    while packed[-2:] == b"\0\0":
        packed = packed[:-2]
    return packed


def _belong(connection, rows):
    if rows:
        connection.exec_driver_sql("INSERT OR IGNORE INTO record_event (record, event) VALUES (?, ?)", rows)


_INSERT = (
    "INSERT INTO record (id, machine, kind, number, boot, sequence, begun, entry, outcome, ended, seconds, paused, pause, missed, alarms, "
    f"definition, key, value, fields, memo) VALUES ({', '.join('?' * 20)}) RETURNING id"
)


def _create():
    op.create_table(
        "record",
        sa.Column("id", sa.Integer, nullable=False),
        sa.Column("machine", sa.Integer, nullable=False),
        sa.Column("kind", sa.String, nullable=False),
        sa.Column("number", sa.BigInteger, nullable=False),
        sa.Column("boot", sa.Integer, nullable=False),
        sa.Column("sequence", sa.BigInteger, nullable=False),
        sa.Column("begun", sa.BigInteger, nullable=False),
        sa.Column("entry", sa.Integer, nullable=False),
        sa.Column("outcome", sa.String, nullable=False),
        sa.Column("ended", sa.BigInteger),
        sa.Column("seconds", sa.Float),
        sa.Column("paused", sa.BigInteger, nullable=False),
        sa.Column("pause", sa.BigInteger),
        sa.Column("missed", sa.Integer, nullable=False),
        sa.Column("alarms", sa.String, nullable=False),
        sa.Column("definition", sa.String, nullable=False),
        sa.Column("key", sa.String, nullable=False),
        sa.Column("value", sa.Float),
        sa.Column("fields", sa.String, nullable=False),
        sa.Column("memo", sa.String, nullable=False),
        sa.PrimaryKeyConstraint("id", name="pk_record"),
    )
    op.create_index("ix_record_begun", "record", ["kind", "begun"])
    op.create_index("ix_record_machine", "record", ["machine", "kind", "begun"])
    op.create_index("ix_record_number", "record", ["machine", "kind", "number"])
    op.create_index("ix_record_open", "record", ["machine", "kind"], sqlite_where=sa.text("outcome = 'open'"))
    op.create_index("ix_record_key", "record", ["machine", "kind", "key"], sqlite_where=sa.text("key <> ''"))
    op.create_table(
        "record_part",
        sa.Column("record", sa.Integer, nullable=False),
        sa.Column("number", sa.Integer, nullable=False),
        sa.Column("key", sa.String, nullable=False),
        sa.Column("state", sa.String, nullable=False),
        sa.Column("begun", sa.BigInteger),
        sa.Column("ended", sa.BigInteger),
        sa.Column("seconds", sa.Float),
        sa.Column("paused", sa.BigInteger, nullable=False),
        sa.PrimaryKeyConstraint("record", "number", name="pk_record_part"),
        sqlite_with_rowid=False,
    )
    op.create_table(
        "record_event",
        sa.Column("record", sa.Integer, nullable=False),
        sa.Column("event", sa.Integer, nullable=False),
        sa.PrimaryKeyConstraint("record", "event", name="pk_record_event"),
        sqlite_with_rowid=False,
    )
    op.create_table(
        "definition",
        sa.Column("id", sa.String, nullable=False),
        sa.Column("text", sa.String, nullable=False),
        sa.PrimaryKeyConstraint("id", name="pk_definition"),
    )
