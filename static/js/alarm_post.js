// What a person asks of the alarms: posts it, says what became of it in the message line.
import { answered, parsed } from "./fetched.js";

/** Post `fields` ([name, value] pairs) to `url`; true when it was taken. Nothing is asked while nobody answers. */
export async function post(url, fields) {
  const { say } = window.pogon, { network, refused } = document.getElementById("message").dataset;
  if (document.body.dataset.live === "offline") {
    say(document.getElementById("alarms").dataset.offline, "error");
    return false;
  }
  const answer = await answered(url, { fields, limit: 10000 });
  if (!answer) {
    say(network, "error");
    return false;
  }
  if (answer.headers.get("hx-redirect")) location.assign(answer.headers.get("hx-redirect"));
  else if (answer.redirected) location.assign(answer.url);
  const line = parsed(answer.text).querySelector("[data-message]");
  say(line?.textContent.trim() || refused, answer.ok ? line?.dataset.kind ?? "done" : "error");
  return answer.ok;
}

/** Ask in a dialog; true for yes. */
export function ask(dialog, question) {
  dialog.querySelector("[data-question]").textContent = question;
  dialog.returnValue = "";
  dialog.showModal();
  return new Promise((done) => dialog.addEventListener("close", () => done(dialog.returnValue === "yes"), { once: true }));
}
