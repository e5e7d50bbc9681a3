"""Product tracking: where every product on a line is, from the encoders of its belts, corrected by the sensors.

The block is `tracking`; its parts work on one `table`, in the words of `product`.
"""

from app.blocks.product_tracking.product import (
    BLIND,
    STUCK,
    Code,
    EditReason,
    EditRefused,
    Gap,
    GatePosition,
    LineLayout,
    Product,
    ProductState,
    Settings,
    TrackingEvent,
    share,
)
from app.blocks.product_tracking.tracking import ProductTracking

__all__ = [
    "BLIND",
    "STUCK",
    "Code",
    "EditReason",
    "EditRefused",
    "Gap",
    "GatePosition",
    "LineLayout",
    "Product",
    "ProductState",
    "ProductTracking",
    "Settings",
    "TrackingEvent",
    "share",
]
