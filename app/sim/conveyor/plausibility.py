"""When the conveyor's PLC does not trust its table: products whose position or length is uncertain, and slip."""

from collections.abc import Iterable, Sequence

from app.blocks.product_tracking import Code, Product, ProductState, ProductTracking, TrackingEvent
from app.sim.conveyor.machine import Geometry

_CERTAIN = (ProductState.TRACKED, ProductState.OUTSIDE)
_AT_SENSOR = (Code.HEAD_AT_SENSOR, Code.TAIL_AT_SENSOR, Code.UNEXPECTED)


class UncertainProducts:
    """What was told and makes a product, or the next one, uncertain beyond the scan in which it was told."""

    def __init__(self) -> None:
        self._entry = False
        """Something was at S2 that S1 had not seen."""
        self._lengths: set[int] = set()
        """Ids of products of which two sensors measured different lengths."""

    def look(self, tracking: ProductTracking, happened: Sequence[TrackingEvent], tolerance: float) -> None:
        """Make uncertain whom the events of this scan are about; lengths may differ by `tolerance` [mm]."""
        self._look_at_lengths(tracking, happened, tolerance)
        self._look_at_first_edges(tracking, happened)

    def confirmed(self, id: int) -> None:
        """A person has looked at a product; 0 = at all."""
        self._lengths = self._lengths - {id} if id else set()

    def _look_at_lengths(self, tracking: ProductTracking, happened: Sequence[TrackingEvent], tolerance: float) -> None:
        """Two sensors that disagree on a length leave the product uncertain until a third agrees with one of them."""
        differing = {
            event.id for event in happened if event.code == Code.LENGTH_DIFFERS and abs(event.value) > tolerance
        }
        agreeing = {event.id for event in happened if event.code == Code.TAIL_AT_SENSOR} - differing
        self._lengths = (self._lengths | differing) - agreeing
        if self._lengths:
            uncertain = [product for product in tracking.products if product.id in self._lengths]
            self._lengths = {product.id for product in uncertain}
            for product in uncertain:
                _make_uncertain(product)

    def _look_at_first_edges(self, tracking: ProductTracking, happened: Sequence[TrackingEvent]) -> None:
        """A sensor that has just begun to work again may have done so in the middle of a product; so may S1 after it missed one."""
        again = {event.source for event in happened if event.code == Code.SENSOR_OK}
        for event in happened:
            if event.code == Code.UNEXPECTED and event.source == 2:
                self._entry = True
            elif event.code == Code.ARRIVED and self._entry:
                self._entry = False
                again.add(1)
        if not again:
            return
        seen = {event.id for event in happened if event.source in again and event.id}
        for product in tracking.products:
            if product.id in seen:
                _make_uncertain(product)


def make_belt_uncertain(products: Iterable[Product], begin: float, end: float, *, across: bool = False) -> None:
    """Nobody knows where the products on the belt from `begin` to `end` [mm] are until a sensor sees them; `across`: only those that lie
    on another one, too."""
    for product in products:
        on_it = product.right > begin and product.left < end
        if on_it and not (across and begin <= product.left and product.right <= end):
            _make_uncertain(product)


def slip_of(event: TrackingEvent, tracking: ProductTracking, geometry: Geometry) -> tuple[int, float] | None:
    """Belt and slip [%] that a sensor's event shows: deviation of a head as part of the way from the sensor before, of a tail as part of
    the length. None when it shows none: of a product that has just come there is no way yet."""
    if event.source < 2 or event.code not in _AT_SENSOR:
        return None
    product = next((product for product in tracking.slots if product and product.id == event.id), None)
    if product is None or product.entered_us == tracking.now:
        return None
    end = geometry.sensors[event.source - 1]
    if event.code == Code.TAIL_AT_SENSOR:
        end += product.length
        way = product.length
    else:
        way = end - geometry.sensors[event.source - 2]
    belt = next((n for n, last in enumerate(geometry.belt_ends, 1) if end - way / 2 <= last), geometry.belts)
    return belt, 100 * abs(event.value) / way


def _make_uncertain(product: Product) -> None:
    if product.state in _CERTAIN:
        product.state = ProductState.UNCERTAIN
    elif product.state is not ProductState.LOST:
        product.settled = ProductState.UNCERTAIN
