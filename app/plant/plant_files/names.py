"""Names that a plant file gives: of areas, links and machines."""

import re

from app.plant.said import said
from app.plant.tables import Table

ID = r"[a-z][a-z0-9_]{0,31}"
RESERVED_IDS = ("sys",)
ID_EXPECTED = said("mistake.id", reserved=", ".join(RESERVED_IDS))


def check_id(key: str, table: Table) -> None:
    """Note a name that no area, link or machine may have."""
    if not re.fullmatch(ID, key) or key in RESERVED_IDS:
        table.note("", key, ID_EXPECTED)
