"""Persons at a running Pogon in this process: accounts with hashes that cost little, sessions, forms as our pages send them."""

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from fastapi.testclient import TestClient

from app.access.access import Access
from app.access.passwords import Cost, Passwords
from app.access.roles import Person, permissions_of

HOST = "http://127.0.0.1:8000"
PASSWORD = "tri plave ladice u kutu"
AGENT = "testclient"
BOSS = Person(0, "boss", "boss", frozenset({"admin"}), permissions_of({"admin", "engineer", "operator"}), "")

T = TypeVar("T")


class Staff:
    """The people of a running Pogon; the browser is one and changes its cookie."""

    def __init__(self, client: TestClient) -> None:
        self.client = client
        self.access: Access = client.app.state.runtime.access  # type: ignore[attr-defined]
        self.access.passwords._hasher = Passwords(Cost(1, 64, 1))._hasher
        self.access.throttle.take = lambda _address: True  # type: ignore[method-assign]
        self._ids: dict[str, int] = {}

    def wait(self, work: Callable[..., Any], *arguments: Any, **named: Any) -> Any:
        """Do `work` on the server's loop."""
        assert self.client.portal is not None
        return self.client.portal.call(lambda: work(*arguments, **named))

    def add(self, name: str, *roles: str) -> int:
        """An account with a password of its own, made once."""
        if name not in self._ids:
            account, _ = self.wait(self.access.people.add, BOSS, name, "", roles)
            self.access.people.set_password_now(BOSS, name, PASSWORD)
            self._ids[name] = account.id
        return self._ids[name]

    def enter(self, name: str, *roles: str) -> str:
        """Sign `name` in: the browser has a new session now."""
        self.add(name, *(roles or ("operator",)))
        sid: str = self.wait(self.access.sign_in.with_password, name, PASSWORD, "127.0.0.1", AGENT).sid
        self.have(sid)
        return sid

    def have(self, sid: str = "") -> None:
        """The browser has this session, or none."""
        self.client.cookies.clear()
        if sid:
            self.client.cookies.set("sid", sid)

    def post(self, path: str, data: Mapping[str, Any] | None = None, **headers: str) -> Any:
        """Send a form as a page of ours does."""
        bound = self.client.cookies.get("sid") or self.client.cookies.get("pre")
        if not bound:
            bound = "a" * 22
            self.client.cookies.set("pre", bound)
        form = {"csrf": self.access.form_token(bound), **(data or {})}
        return self.client.post(path, data=form, headers={"Origin": HOST, **headers})
