"""Draws requests: a known address or form, and in it what nobody of ours would send."""

import json
from random import Random
from typing import Any

from tests.fuzz.asking import FILES, FORM, JSON, Request, address
from tests.fuzz.pages import Form
from tests.fuzz.routes import PARTS, Routes
from tests.fuzz.values import BODIES, CSRF, FRESH, NONCE, TEXTS, TREES, Field, hostile, tame
from tests.fuzz.values import FILES as UPLOADS

MARKS = {"csrf": CSRF, "nonce": NONCE, "id": FRESH}
LANGUAGES = ("hr", "en", "de", "cs")
MOST_FIELDS = 40


class Drawer:
    """Everything from one `random`, and from what is known of the house so far."""

    def __init__(self, random: Random, routes: Routes, who: tuple[str, ...], password: str) -> None:
        self._random, self._routes, self._who, self._password = random, routes, who, password
        self._table = [route for route in routes.table if "/static/" not in route]

    def request(self) -> Request:
        """The next one."""
        random = self._random
        weights = [self._weight(route) for route in self._table]
        method, _, template = random.choices(self._table, weights)[0].partition(" ")
        who = random.choices(self._who, [5 if one == "ada" else 1 for one in self._who])[0]
        more = {
            "who": who,
            "language": random.choice(LANGUAGES),
            "wait": random.choice((0, 0, 0.05, 0.3)),
            "fragment": random.random() < 0.6,
        }
        if method == "LIVE":
            return Request(method=method, address=template, said=self._said(), **more)
        if method == "POST":
            return self._post(template, more)
        where = self._place(template)
        query = [] if random.random() < 0.2 else self._pairs(list(self._routes.fields[template].values()), thin=True)
        return Request(method=method, address=address(where, query)[:60_000], **more)

    def _weight(self, route: str) -> float:
        """A form is sent more often than a page is looked at, and the more often the more there are of its route."""
        return 2.0 + len(self._routes.forms[route]) / 3 if route.startswith("POST") else 1.0

    def _place(self, template: str) -> str:
        """An address of `template`; one in eight has a part that is none."""
        random = self._random
        seen = [one.partition("?")[0] for one in self._routes.seen[template]]
        if seen and random.random() < 0.4:
            return random.choice(seen)
        spoiled = random.choice(PARTS.findall(template)) if PARTS.search(template) and random.random() < 0.3 else ""

        def choose(name: str, known: list[str]) -> str:
            if name != spoiled and known:
                return random.choice(known)
            if name != spoiled:
                return random.choice("123")
            return hostile(random, random.choice(("number", "text")))[:3000] or "1"

        return self._routes.filled(template, choose)

    def _post(self, template: str, more: dict[str, Any]) -> Request:
        random, route = self._random, f"POST {template}"
        chance = random.random()
        if chance < 0.03:
            return Request(method="POST", address=self._place(template), raw=random.choice(UPLOADS), kind=FILES, **more)
        if chance < 0.07:
            return Request(
                method="POST",
                address=self._place(template),
                raw=random.choice(BODIES),
                kind=random.choice((FORM, JSON)),
                **more,
            )
        if template.startswith("/api/"):
            tree = self._tree(self._routes.bodies.get(route, {}), spoil=random.random() < 0.8)
            raw = json.dumps(tree).encode()
            if random.random() < 0.1:
                raw = raw.replace(b"}", b',"id":1}', 1)
            return Request(method="POST", address=self._place(template), raw=raw, kind=JSON, **more)
        forms = list(self._routes.forms[route].values())
        form = random.choice(forms) if forms and random.random() < 0.9 else Form("POST", self._place(template))
        had = {one.name for one in form.fields}
        asked = [
            self._routes.field(name)
            for name, needed in self._routes.wanted[template].items()
            if name not in had and name not in MARKS and random.random() < (0.95 if needed else 0.2)
        ]
        fields = [*form.fields, *asked]
        action = form.action if random.random() < 0.93 else self._place(template)
        pairs = self._pairs([one for one in fields if one.name not in MARKS])
        names = [name for name in MARKS if name == "csrf" or name in had or name in self._routes.wanted[template]]
        pairs += [(name, MARKS[name]) for name in names if random.random() < 0.97]
        return Request(method="POST", address=action, form=tuple(pairs), **more)

    def _pairs(self, fields: list[Field], thin: bool = False) -> list[tuple[str, str]]:
        """Values for `fields`: all as they should be, one that is not, or many; some missing, doubled, or of no field at all."""
        random = self._random
        if thin:
            fields = [one for one in fields if random.random() < 0.5] or fields[:1]
        fields = fields[:MOST_FIELDS]
        manner = random.random()
        spoiled = {random.randrange(len(fields))} if fields and manner < 0.55 else set()
        if manner > 0.8:
            spoiled = {number for number in range(len(fields)) if random.random() < 0.4}
        found: list[tuple[str, str]] = []
        for number, one in enumerate(fields):
            if one.kind == "ticked" and number not in spoiled and random.random() < 0.4:
                continue
            if random.random() < 0.03:
                continue
            known = self._known(one) if number not in spoiled and not one.value and not one.choices else ""
            value = hostile(random, one.kind) if number in spoiled else known or tame(random, one, self._password)
            found.append((one.name, value))
            if random.random() < 0.04:
                found.append((one.name, hostile(random, one.kind)))
        if random.random() < 0.04:
            found.append((random.choice(TEXTS)[:200] or "x", "1"))
        return found

    def _known(self, one: Field) -> str:
        """What stands for such a name in addresses of ours."""
        pool = list(self._routes.pool.get(one.name, ()))
        return self._random.choice(pool) if pool and self._random.random() < 0.5 else ""

    def _tree(self, schema: dict[str, Any], spoil: bool) -> Any:
        """A JSON value for `schema`; with `spoil` some of it is of another kind."""
        random = self._random
        if spoil and random.random() < 0.15:
            return random.choice((*TREES, hostile(random, "number"), hostile(random, "text")))
        for key in ("anyOf", "oneOf", "allOf"):
            if key in schema:
                return self._tree(random.choice(schema[key]), spoil)
        if "enum" in schema:
            return random.choice(schema["enum"])
        match schema.get("type"):
            case "object":
                named = schema.get("properties", {})
                found = {
                    name: MARKS[name] if name in MARKS and random.random() < 0.95 else self._tree(one, spoil)
                    for name, one in named.items()
                    if name in schema.get("required", ()) or random.random() < 0.5
                }
                if not named:
                    found = {
                        random.choice(("1", "speed", "x", *TEXTS))[:99]: self._tree(
                            schema.get("additionalProperties") or {"type": "number"}, spoil
                        )
                    }
                return found
            case "array":
                return [self._tree(schema.get("items", {}), spoil) for _ in range(random.choice((0, 1, 2)))]
            case "integer":
                return random.choice((0, 1, 2, -1, 10**18)) if spoil else 1
            case "number":
                return random.choice((0, 1.5, 20, -3, 1e308)) if spoil else 10
            case "boolean":
                return random.random() < 0.7
            case "string":
                return (
                    hostile(random, "text")[:12_000]
                    if spoil and random.random() < 0.5
                    else random.choice(("1", "fuzz reason"))
                )
            case _:
                return random.choice(TREES)

    def _said(self) -> tuple[str | bytes, ...]:
        """What a page says over its socket."""
        random = self._random
        kinds = [*self._routes.kinds, *(f"tags/{one}" for one in list(self._routes.pool["name"])[:10])]
        said: list[str | bytes] = []
        for _ in range(random.choice((1, 2, 3, 5, 40))):
            chance = random.random()
            if chance < 0.45 and kinds:
                rev = random.choice((0, 1, -1, 10**30, "1", None, 1.5))
                said.append(json.dumps({"subscribe": random.choice(kinds), "rev": rev}))
            elif chance < 0.55:
                kind = random.choice(("tags/", "", "equipment/", *kinds[:3])) + hostile(random, "text")[:4000]
                said.append(json.dumps({"subscribe": kind}))
            elif chance < 0.75:
                tree = {
                    "equipment": random.choice(list(self._routes.pool["equipment/{key}"]) or ["m1"]),
                    "lease": "x",
                    "counter": 1,
                }
                tree[random.choice(list(tree))] = random.choice((*TREES, *TEXTS))
                if random.random() < 0.5:
                    tree["release"] = random.choice((*TREES, *TEXTS))
                    del tree["counter"]
                said.append(json.dumps({"hold": tree}))
            elif chance < 0.9:
                said.append(json.dumps(random.choice(({"snapshot": True}, {"pong": 1}, *TREES))))
            else:
                said.append(
                    random.choice(
                        (
                            b"\xff\x00",
                            b"{}",
                            "{",
                            "[" * 4000,
                            "x" * 5000,
                            '{"hold":' * 500,
                            "",
                            "\x00",
                            '{"subscribe":"\\ud800"}',
                        )
                    )
                )
        return tuple(said)
