"""Which page an address belongs to: what a person reads instead of the address."""

PAGES = {
    "/": "nav.overview",
    "/account": "access.account",
    "/account/factor": "access.factor.title",
    "/alarms": "alarm.list",
    "/alarms/statistics": "alarm.stats.title",
    "/api": "api.title",
    "/area": "nav.overview",
    "/audit": "audit.title",
    "/communication": "nav.communication",
    "/docs": "api.title",
    "/equipment/*/ask": "frame.commands",
    "/equipment/*/command": "frame.commands",
    "/equipment/*/commands": "frame.commands",
    "/equipment/*/definition": "editor.title",
    "/equipment/*/drive-parameters": "dpar.title",
    "/equipment/*/drive-parameters/compare": "dcmp.title",
    "/equipment/*/encoder": "enc.title",
    "/equipment/*/events": "events.title",
    "/equipment/*/fault-buffer": "fbuf.title",
    "/equipment/*/hold": "frame.commands",
    "/equipment/*/jog-speeds": "jog.title",
    "/equipment/*/parameters": "par.title",
    "/equipment/*/release": "frame.commands",
    "/equipment/*/setpoint": "frame.commands",
    "/equipment/*/stop": "frame.commands",
    "/equipment/*/token": "control.title",
    "/events": "events.title",
    "/favourites": "nav.overview",
    "/forces": "forces.title",
    "/help": "help.title",
    "/history": "history.title",
    "/instructor": "instructor.title",
    "/lessons": "lessons.title",
    "/nonce": "frame.commands",
    "/palette": "palette.title",
    "/plant": "plant.title",
    "/products": "records.title",
    "/records": "records.title",
    "/runs": "records.title",
    "/screens": "nav.screens",
    "/simulation": "instructor.speed",
    "/storage": "storage.title",
    "/today": "today.title",
    "/tokens": "access.tokens",
    "/trends": "trend.title",
    "/users": "access.users",
    "/users/review": "access.review",
    "/welcome": "welcome.title",
    "/why": "nav.overview",
}
"""Begin of an address, `*` for any one part → the text that names its page."""


def name_of(path: str) -> str:
    """The text key of the page to which `path` belongs; empty for what has a machine's name and no other, and for what is no page.

    `path` is an address or the pattern of a route: `/equipment/m1/encoder/start` and `/equipment/{key}/encoder` are of one page.
    """
    parts = path.removesuffix(".csv").strip("/").split("/")
    if parts[0] == "equipment" and len(parts) > 1:
        parts[1] = "*"
    for length in range(len(parts), 0, -1):
        if found := PAGES.get("/" + "/".join(parts[:length])):
            return found
    return ""
