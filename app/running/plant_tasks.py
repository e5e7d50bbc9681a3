"""The tasks that there are only while there is a plant: its simulation, one for each link, its commands and what it retains."""

from collections.abc import Awaitable, Callable, Mapping

from app.links.register_link import RegisterLink
from app.sim.plant import SimPlant
from app.supervisor import Supervisor

Work = Callable[[], Awaitable[None]]
"""What the supervisor keeps running."""

SIMULATION, RETAINED, COMMANDS, MEMORIES = "simulation", "retained", "commands", "memories"


class PlantTasks:
    """Has the supervisor start and end them."""

    def __init__(self, supervisor: Supervisor) -> None:
        self._supervisor = supervisor

    def retain(self, derived: Work, memories: Work) -> None:
        """Derived points that are kept are written now and then, and what simulated devices save."""
        self._supervisor.start(RETAINED, derived)
        self._supervisor.start(MEMORIES, memories)

    def follow_commands(self, work: Work) -> None:
        """What is pending at the gate goes on."""
        self._supervisor.start(COMMANDS, work)

    def run(self, sim: SimPlant | None, links: Mapping[str, RegisterLink]) -> None:
        """The simulation and every link have a task, from now on if they had none."""
        works: dict[str, Work] = {SIMULATION: sim.run} if sim is not None else {}
        works |= {_of_link(name): link.run for name, link in links.items()}
        for name, work in works.items():
            if name not in self._supervisor.tasks:
                self._supervisor.start(name, work)

    async def end_links(self, former: Mapping[str, RegisterLink], links: Mapping[str, RegisterLink]) -> None:
        """The tasks of links that `links` has no more, or has another one for, end."""
        for name in [name for name, link in former.items() if links.get(name) is not link]:
            await self._supervisor.end(_of_link(name))

    async def end_simulation(self) -> None:
        """Its task ends."""
        await self._supervisor.end(SIMULATION)

    async def end(self) -> None:
        """There is no plant any more."""
        own = [SIMULATION, RETAINED, COMMANDS, MEMORIES]
        for name in [name for name in self._supervisor.tasks if name in own or name.startswith(_of_link(""))]:
            await self._supervisor.end(name)


def _of_link(name: str) -> str:
    return f"link.{name}"
