// STOP does not go through the page's websocket: one request of its own, which either succeeds or says loudly that it
// did not.
"use strict";

const button = document.getElementById("dp-stop");
const says = document.getElementById("dp-stop-says");
let quiet;

async function stop() {
  if (button.disabled) return; // A replay: there is nothing to stop.
  button.classList.add("dp-pressed");
  try {
    const reply = await fetch("/stop", { method: "POST", keepalive: true, signal: AbortSignal.timeout(2000) });
    if (!reply.ok) throw new Error(`status ${reply.status}`);
    say("Stop delivered", "dp-good");
  } catch (error) {
    say("STOP NOT DELIVERED: use the hardware stop", "dp-bad");
  } finally {
    button.classList.remove("dp-pressed");
  }
}

function say(text, tone) {
  says.textContent = text;
  says.className = tone;
  clearTimeout(quiet);
  if (tone === "dp-good") quiet = setTimeout(() => (says.textContent = ""), 4000);
}

// A picture that has stopped moving looks like a rope that lies still.
async function check() {
  const reply = await fetch("/alive", { signal: AbortSignal.timeout(2000) }).catch(() => null);
  document.getElementById("dp-lost").hidden = reply !== null && reply.ok;
}

// The mode belongs into the bar, which is in view wherever the panels are scrolled to.
const now = document.getElementById("dp-mode-now");

function mirror() {
  const card = document.querySelector(".dp-mode");
  if (card === null || now.dataset.said === card.dataset.said) return;
  now.dataset.mode = card.dataset.mode;
  now.textContent = now.dataset.said = card.dataset.said;
}

// Files that are a goal go by a request of their own; viser's way is for small things.
async function sendGoal(input) {
  const says = input.closest(".dp").querySelector("[data-goal-says]");
  const form = new FormData();
  form.append("key", document.querySelector("[data-key]").dataset.key);
  form.append("camera", input.closest(".dp").querySelector("[data-goal-camera]").value);
  for (const file of input.files) form.append("files", file);
  says.textContent = "Sending";
  const reply = await fetch("/goal", { method: "POST", body: form }).catch(() => null);
  says.textContent = reply === null ? "No connection." : await reply.text();
  input.value = "";
}

document.addEventListener("change", (event) => event.target.matches("[data-goal-files]") && sendGoal(event.target));
setInterval(mirror, 250);
setInterval(check, 2000);
button.addEventListener("pointerdown", stop);
// A click without a pointer comes from the keyboard or from assistive software.
button.addEventListener("click", (event) => event.detail === 0 && stop());
// On the way down, so that no text field and no dialog can swallow it.
window.addEventListener("keydown", (event) => event.key === "Escape" && !event.repeat && stop(), { capture: true });
