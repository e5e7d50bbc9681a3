"""Goes to a page, fills in one of its forms as a person would, breaks at most one field of it and sends it: so it gets past the door.

What is drawn without looking (drawing.py) is refused at the first field that does not fit the others. Here only one thing is wrong, so what
a handler does behind its checks is asked too: drafts, dialogs, lessons under way, lists that somebody fills.
"""

from collections.abc import Iterator
from dataclasses import replace
from random import Random

from tests.fuzz.asking import Request
from tests.fuzz.drawing import LANGUAGES, MARKS
from tests.fuzz.house import House
from tests.fuzz.pages import Form
from tests.fuzz.values import WORDS, Field, fitting, hostile

BROKEN = 0.65
"""Of the forms that are sent have one field that nobody of ours would send."""
FORMS_OF_A_PAGE = 3
WHO = ("ada", "ada", "ada", "eva", "ivo")


class Walker:
    """Everything from one `random`, and from what the house serves now."""

    def __init__(self, random: Random, one: House, about: tuple[str, ...], password: str) -> None:
        """`about`: parts of addresses; only forms that lead to such a one are sent, or all where there is none."""
        self._random, self._one, self._about, self._password = random, one, about, password

    def requests(self) -> Iterator[Request]:
        """To a page and back with some of its forms; the house has answered one before the next is drawn."""
        random, routes = self._random, self._one.routes
        known = [route for route, where in routes.where.items() if where and self._is_meant(route)]
        if not known:
            return
        route = random.choice(known)
        who, language = random.choice(WHO), random.choice(LANGUAGES)
        where = random.choice(list(routes.where[route])[-4:])
        yield Request(who, "GET", where, language=language, wait=random.choice((0, 0, 1.5)))
        page = self._one.page
        forms = [form for form in page.forms if self._is_meant(f"POST {form.action}")] if page else []
        meant = [form for form in forms if f"POST {routes.of('POST', form.action)}" == route]
        for form in random.sample(meant, min(len(meant), FORMS_OF_A_PAGE)) or forms[:1]:
            yield self._sent(form, page.data if page else [], who, language)

    def _is_meant(self, route: str) -> bool:
        return route.startswith("POST ") and (not self._about or any(one in route for one in self._about))

    def _sent(self, form: Form, data: list[tuple[str, str]], who: str, language: str) -> Request:
        random, routes = self._random, self._one.routes
        pairs = self._filled(form.fields)
        had = {one.name for one in form.fields}
        for name, needed in routes.wanted[routes.of("POST", form.action)].items():
            known = [value for of, value in data if of == name]  # what a script takes from the element that is pressed
            known = known or list(routes.pool.get(name, ()))
            if name not in had and name not in MARKS and random.random() < (1.0 if needed else 0.6 if known else 0.1):
                pairs.append((routes.field(name), random.choice(known or WORDS)))
        if "csrf" not in had:
            pairs.append((Field("csrf", "hidden"), ""))  # htmx sends it in a header
        own = [number for number, (one, _) in enumerate(pairs) if one.name not in MARKS]
        if own and random.random() < BROKEN:
            number = random.choice(own)
            one, value = pairs[number]
            match random.random():
                case chance if chance < 0.75:
                    kind = one.kind if one.kind in ("number", "time", "choice") else "text"
                    pairs[number] = one, hostile(random, kind)
                case chance if chance < 0.85:
                    del pairs[number]
                case chance if chance < 0.92:
                    pairs.append((one, value))
                case _:
                    pairs[number] = replace(one, name=f"{one.name}{random.choice(('.1', '-', 'x', '[]'))}"), value
        fields = tuple((one.name, MARKS.get(one.name, value)) for one, value in pairs)
        return Request(who, "POST", form.action, fields, fragment=random.random() < 0.5, language=language)

    def _filled(self, fields: list[Field]) -> list[tuple[Field, str]]:
        """What a browser sends of it: of radios and of buttons one, of boxes what is ticked or another one."""
        random = self._random
        buttons = [one for one in fields if one.one_of == "button" and one.on]
        pressed = random.choice(buttons) if buttons else None
        radios: dict[str, list[Field]] = {}
        for one in fields:
            if one.one_of == "radio":
                radios.setdefault(one.name, []).append(one)
        chosen = [random.choice(several) for several in radios.values()]
        found = []
        for one in fields:
            if one.one_of == "button":
                sent = one is pressed
            elif one.one_of == "radio":
                sent = one in chosen
            elif one.kind == "ticked":
                sent = one.on != (random.random() < 0.3)
            else:
                sent = one.on
            if sent:
                found.append((one, one.value if one.kind == "ticked" else fitting(random, one, self._password)))
        return found
