"""What a sequence may have any machine do: declared actions, each one or several commands of the machine's type in their order.

    [actions.orders.run_forward]                        device.toml of the type
    commands = [{ command = "set_frequency", value = "frequency" }, { command = "forward" }]

A command goes through the gate as a person's does; `value` names what a step gives for it. Only what an operator may ask without a
reason, a password or a held button can be an action.
"""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ActionCommand:
    """One command of an action."""

    command: str
    """Of the type."""
    value: str = ""
    """Name of the value that a step gives as its argument; empty = it takes none."""


@dataclass(frozen=True, slots=True)
class Action:
    """What the steps of a sequence may have such a machine do."""

    key: str
    commands: tuple[ActionCommand, ...]

    @property
    def values(self) -> tuple[str, ...]:
        """Names of the values that a step gives."""
        return tuple(each.value for each in self.commands if each.value)
