"""What a sequence may have any machine do: declared actions, each one or several commands of the machine's type in their order.

    [actions.orders.run_forward]                        device.toml of the type
    commands = [{ command = "set_frequency", value = "frequency" }, { command = "forward" }]

    [actions.orders.carry]                              one with an end of its own
    commands = [{ command = "start_cycle" }]            a step gives every argument of the command by its name
    done = "step_state == 4"                            over the type's points: it is over and did what it should
    failed = "step_state == 5"                          it is over and did not
    suspend = "suspend"                                 commands that have it stand still and go on; else Stop, and it is given again
    stands = "moving == 0"                              suspended, it may go on from then on
    resume = "resume"
    stop = "abort"                                      the command that ends it; else the type's Stop

    [actions.orders.feed]                               one that ends with a stop of its own
    label = "order.feed"                                text key; else it is called as its commands are
    arguments = [{ name = "count", type = "u32", low = 1, high = 1000 }]        values that a step gives and its sentences read
    commands = [{ command = "start" }]
    done = "out - before.out >= count"                  `before.out` is what the point `out` said before the first command
    failed = "running == 0"
    then = "stop"                                       given when it is done, and confirmed before it counts as done
    [actions.orders.feed.needs.counter]                 as a permissive: else it is refused and says why
    expression = "counter_fault == 0"

    [actions.orders.to_the_gate]
    commands = [{ command = "start" }]
    armed = "at_gate == 0"                              `done` counts only from when this was true
    done = "at_gate == 1"
    then = "stop"

A command goes through the gate as a person's does; `value` names what a step gives for it. Only what an operator may ask without a
reason, a password or a held button can be an action.
"""

from dataclasses import dataclass

from app.plant.argument import Argument
from app.plant.condition import Condition

BEFORE = "before."
"""Begins the name of what a point said before an action began."""


@dataclass(frozen=True, slots=True)
class ActionCommand:
    """One command of an action."""

    command: str
    """Of the type."""
    value: str = ""
    """Name of the value that a step gives as its argument; empty = it takes none."""
    arguments: tuple[str, ...] = ()
    """Names of the values that a step gives as arguments of a code."""
    optional: tuple[str, ...] = ()
    """Those that it may give: the values of the run of a sequence, which else has those of its last one."""


@dataclass(frozen=True, slots=True)
class Action:
    """What the steps of a sequence may have such a machine do."""

    key: str
    commands: tuple[ActionCommand, ...]
    done: str = ""
    """Sentence over the type's points: it has ended well; empty = it has no end of its own, confirmed is all there is to wait for."""
    failed: str = ""
    """It has ended otherwise."""
    suspend: str = ""
    """Command that has it stand still so that `resume` lets it go on; empty = the type's Stop, and then it is given again."""
    resume: str = ""
    stands: str = ""
    """Sentence: what was suspended may go on; empty = at once."""
    stop: str = ""
    """Command that ends it; empty = the type's Stop."""
    then: str = ""
    """Command that is given when `done` is true by two readings; it is over when that is confirmed. Empty = none."""
    armed: str = ""
    """Sentence: `done` counts only from when it was true; empty = at once."""
    arguments: tuple[Argument, ...] = ()
    """Values that a step gives to its sentences and no command takes; their limits are numbers."""
    needs: tuple[Condition, ...] = ()
    """What must be true before it begins; else it is refused."""
    label: str = ""
    """Text key; empty = it is called as its commands are."""

    @property
    def values(self) -> tuple[str, ...]:
        """Names of the values that a step gives."""
        taken = (name for each in self.commands for name in ((each.value,) if each.value else each.arguments))
        return (*taken, *(one.name for one in self.arguments))

    @property
    def optional(self) -> tuple[str, ...]:
        """Names of the values that a step may give."""
        return tuple(name for each in self.commands for name in each.optional)

    @property
    def adjusts(self) -> bool:
        """Whether it only sets values: what the machine did before goes on."""
        return all(each.value for each in self.commands)
