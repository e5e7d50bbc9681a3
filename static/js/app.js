// The frame: what htmx may do, the message line, menus, and what survives a change of language.
(() => {
  "use strict";
  const body = document.body, line = document.getElementById("message");

  // ---- htmx: nothing that is fetched may bring a program along --------------------------------------------------
  // The content policy refuses inline scripts and evaluation already; this holds where it would not, and for scripts of our own address.
  function refuse() { throw new Error("evaluation is off"); }
  const inert = (html) => html;
  const thing = ({ dataset: { part, row, product, occurrence, tags, tag } }) => part ?? row ?? product ?? occurrence ?? tags ?? tag;
  window.htmx?.registerExtension("pogon", {
    init: (api) => {
      const alike = api.isSoftMatch; // an element is changed in place only into the same thing, so that focus and live values stay with theirs
      api.isSoftMatch = (old, fresh) => alike(old, fresh) && thing(old) === thing(fresh);
      api.initSecurity({ createHTML: inert, createScript: () => "" }, refuse, refuse);
    },
    htmx_before_on_init: () => false,
    htmx_before_request: (element, { ctx }) => { ctx.fetch = whole; },
    htmx_after_request: (element, { ctx }) => { ctx.text = withoutScripts(ctx.text); },
    htmx_config_request: (element, { ctx }) => {
      ctx.request.headers["X-Page-Language"] = body.dataset.lang;
      if (element.dataset.liveOnly && body.dataset.live === "offline") {
        say(element.dataset.liveOnly, "error");
        return false;
      }
      if (ctx.request.submitter?.ariaDisabled === "true") {
        const why = ctx.request.submitter.title || element.querySelector("[data-why]")?.textContent.trim() || (body.dataset.live === "offline" && line.dataset.network);
        if (why) say(why, "error");
        return false;
      }
      try { return new URL(ctx.request.action || "", location.href).origin === location.origin; } catch { return false; }
    },
  });

  /** As fetch, but the answer is there with all its text; where none came, or not whole, it is one without words that asks to come again later. */
  async function whole(url, request) {
    try {
      const answer = await window.fetch(url, request), text = await answer.text();
      return new Response(text || null, { status: answer.status, headers: answer.headers });
    } catch (error) {
      if (request.signal.aborted && request.signal.reason !== "timeout") throw error; // another question took its place
      return new Response(null, { status: 503 });
    }
  }

  /** `html` without script elements; parsed by the browser itself, in a document where nothing runs. */
  function withoutScripts(html) {
    if (!/<script/i.test(html)) return html;
    const inside = document.implementation.createHTMLDocument("").createElement("template");
    inside.innerHTML = html;
    for (const script of inside.content.querySelectorAll("script")) script.remove();
    return inside.innerHTML;
  }

  // ---- message line ---------------------------------------------------------------------------------------------
  /** Say `text`, which may be nothing, in the message line; kind is error, done or info. */
  function say(text, kind = "info", time = document.querySelector("[data-clock]").textContent) {
    line.querySelector("time").textContent = text && time;
    line.querySelector("span").textContent = text;
    line.dataset.kind = kind;
  }
  window.pogon = { say };

  const renewed = (element) => element.dataset?.renewed !== undefined;
  document.addEventListener("htmx:response:error", ({ target, detail: { ctx } }) => {
    if (renewed(target)) return;
    const answer = new DOMParser().parseFromString(ctx.text ?? "", "text/html");
    say(answer.querySelector("[data-message]")?.textContent.trim() || (ctx.text ? line.dataset.refused : line.dataset.network), "error");
  });

  // ---- what is fetched again by itself (data-renewed, hx-trigger="…, again"): asked for once more when an answer got lost, and nobody is
  // told, as that nobody answers at all the page says; a list (data-renewed="list") and a part of a screen ("part") wait while a press on
  // them may still become a click, and no longer, as what is shown has to be true; a list that nobody sees waits, too
  const AGAIN = 2000, PAUSE = 300, PRESS = 1000, LATER = [408, 425, 429]; // [ms]; and all of 5xx: the same question may be answered another time
  let down = null, since = 0, ending = 0, still = false;
  for (const begin of ["pointerdown", "keydown"]) document.addEventListener(begin, ({ target, button, key, repeat }) => {
    if (button || (key && (key !== " " || repeat || !target.matches("button")))) return; // nothing that becomes a click
    clearTimeout(ending);
    [down, since, still] = [target, performance.now(), true];
  }, true);
  for (const end of ["pointerup", "pointercancel", "keyup"]) document.addEventListener(end, () => {
    clearTimeout(ending);
    still = false;
    ending = setTimeout(() => { down = null; }, PAUSE);
  }, true);
  const recently = (element) => performance.now() - since < PRESS && element.contains(down);
  window.pogon.pressed = (element) => still && recently(element);
  for (const step of ["htmx:before:request", "htmx:before:swap"])
    document.addEventListener(step, (event) => {
      const { target } = event, kind = target.dataset?.renewed;
      if (!kind || !((kind === "list" && document.hidden) || recently(target))) return;
      event.detail.ctx.late = true;
      event.preventDefault();
    });
  document.addEventListener("htmx:finally:request", ({ target, detail: { ctx } }) => {
    const { response, request: { signal }, late } = ctx;
    if (!renewed(target) || (signal.aborted && signal.reason !== "timeout")) return;
    if (late || response?.status >= 500 || LATER.includes(response?.status)) setTimeout(() => window.htmx.trigger(target, "again"), late ? PAUSE : AGAIN);
  });

  // hx-replace-url: what is looked for stands in the address, without htmx's own history, which would put whole pages here
  document.addEventListener("htmx:after:swap", ({ detail: { ctx } }) => { if (ctx?.replace) history.replaceState(null, "", ctx.request.action); });

  // ---- menus ----------------------------------------------------------------------------------------------------
  const menus = () => document.querySelectorAll("details.drop[open]");
  document.addEventListener("pointerdown", ({ target }) => {
    for (const menu of menus()) if (!menu.contains(target)) menu.open = false;
  });
  document.addEventListener("keydown", ({ key }) => {
    if (key !== "Escape") return;
    for (const menu of menus()) {
      menu.open = false;
      menu.querySelector("summary").focus();
    }
  });
  document.addEventListener("toggle", ({ target, newState }) => {
    if (newState === "open" && target.matches?.("details.drop")) for (const menu of menus()) if (menu !== target) menu.open = false;
    if (newState === "open" && target.matches?.(".a-aside")) target.scrollIntoView({ block: "nearest" }); // what it opens is seen
  }, true);

  // ---- who signs in or out in another window of this browser does so here, too --------------------------------------
  const WHO = "pogon.who", who = document.querySelector("[data-who]")?.dataset.who;
  try { if (who !== undefined) localStorage.setItem(WHO, who); } catch { /* private window: this one alone */ }
  addEventListener("storage", ({ key, newValue }) => { if (key === WHO && newValue !== null && newValue !== who) location.reload(); });

  // ---- tabs: where one is stands in view, however narrow the screen ------------------------------------------------
  [...document.querySelectorAll(".tabs [aria-current]")].pop()?.scrollIntoView({ block: "nearest", inline: "center" });

  // ---- search, help and the keys that lead somewhere ----------------------------------------------------------------
  const awaited = (name) => import(body.dataset.palette).then(({ show }) => show(name)).catch(() => { say(line.dataset.network, "error"); });
  const over = (name) => (window.pogon.over ?? awaited)(name);
  function point() { // the palette named an action: it is pressed here, by hand
    const wanted = location.hash.startsWith("#do-") && CSS.escape(location.hash.slice(4));
    if (wanted) for (const name of ["command", "hold", "setpoint"])
      document.querySelector(`[data-${name}$=".${wanted}"]:not([hidden])`)?.focus({ focusVisible: true });
  }
  point();
  window.addEventListener("hashchange", point);
  document.addEventListener("click", ({ target }) => {
    const at = target.closest?.("[data-over]");
    if (!at) return;
    for (const menu of menus()) menu.open = false;
    over(at.dataset.over);
  });
  document.addEventListener("keydown", (event) => {
    const { key, altKey, shiftKey } = event, control = event.ctrlKey || event.metaKey;
    const place = !control && { F2: "/", F4: "/alarms", F6: "/trends" }[key], dialogs = document.querySelectorAll("dialog[open]");
    if (altKey || shiftKey || (dialogs.length && !place)) return;
    if ([...dialogs].some((one) => one.matches(".ask, :has([data-ask])") || [...one.querySelectorAll("input, textarea")].some(changed))) return;
    if (place) location.assign(place);
    else if (control && key.toLowerCase() === "k") over("/palette");
    else if (!control && key === "F1") over("/help");
    else return;
    event.preventDefault();
  });

  // ---- what was typed is there again after a change of language or colours, and when who typed it has signed in again ----
  const KEPT = "pogon.typed", here = location.pathname + location.search;
  const fields = () => [...document.querySelectorAll(".content :is(input, select, textarea), .zone :is(input, select, textarea)")]
    .filter((field) => (field.name || field.id) && !["password", "hidden", "file"].includes(field.type));
  const checks = (field) => ["checkbox", "radio"].includes(field.type);
  const key = (field) => [field.form?.id || field.form?.getAttribute("action"), field.name || field.id, checks(field) ? field.value : ""].join();
  const changed = (field) => field.tagName === "SELECT" ? [...field.options].some((option) => option.selected !== option.defaultSelected)
    : checks(field) ? field.checked !== field.defaultChecked : field.value !== field.defaultValue;

  document.addEventListener("submit", ({ target }) => {
    if (!target.matches("form[data-stay]")) return;
    target.querySelector("[name=next]").value = here + location.hash;
    target.dataset.stay = "now";
  });
  const kept = JSON.parse(sessionStorage.getItem(KEPT) ?? "null"), away = kept?.who && !who;
  if (away) for (const way of document.querySelectorAll('[href^="/signin"]')) way.search = `?next=${encodeURIComponent(kept.path)}`;
  else sessionStorage.removeItem(KEPT);
  addEventListener("pagehide", () => {
    const typed = Object.fromEntries(fields().filter(changed).map((field) => [key(field), checks(field) ? field.checked : field.value]));
    const stays = !!document.querySelector("[data-stay=now]"), scroll = [scrollY, document.getElementById("content").scrollTop];
    sessionStorage.setItem(KEPT, JSON.stringify(away ? { ...kept, stays: true } : { who, path: here, stays, typed, scroll }));
  });
  if (kept?.stays && kept.who === who && kept.path === here) {
    for (const field of fields().filter((one) => key(one) in kept.typed)) {
      field[checks(field) ? "checked" : "value"] = kept.typed[key(field)];
      field.dispatchEvent(new Event("input", { bubbles: true }));
    }
    window.scrollTo(0, kept.scroll[0]);
    document.getElementById("content").scrollTop = kept.scroll[1];
  }
})();
