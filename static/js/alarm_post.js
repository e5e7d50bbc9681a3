// What a person asks of the alarms: posts it, says what became of it in the message line.
const body = document.body;

/** Post `fields` ([name, value] pairs) to `url`; true when it was taken. Nothing is asked while nobody answers. */
export async function post(url, fields) {
  const say = window.pogon.say;
  if (body.dataset.live === "offline") {
    say(document.getElementById("alarms").dataset.offline, "error");
    return false;
  }
  const csrf = document.querySelector("[name=csrf]")?.value ?? "";
  let answer, html;
  try {
    answer = await fetch(url, {
      method: "POST", body: new URLSearchParams([["csrf", csrf], ...fields]),
      headers: { "HX-Request": "true" }, signal: AbortSignal.timeout(10000),
    });
    html = await answer.text(); // its time may end after the head came
  } catch {
    say(document.getElementById("message").dataset.network, "error");
    return false;
  }
  if (answer.headers.get("hx-redirect")) location.assign(answer.headers.get("hx-redirect"));
  else if (answer.redirected) location.assign(answer.url);
  const line = new DOMParser().parseFromString(html, "text/html").querySelector("[data-message]");
  say(line?.textContent.trim() || document.getElementById("message").dataset.refused, answer.ok ? line?.dataset.kind ?? "done" : "error");
  return answer.ok;
}

/** Ask in a dialog; true for yes. */
export function ask(dialog, question) {
  dialog.querySelector("[data-question]").textContent = question;
  dialog.returnValue = "";
  dialog.showModal();
  return new Promise((done) => dialog.addEventListener("close", () => done(dialog.returnValue === "yes"), { once: true }));
}
