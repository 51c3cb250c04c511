// What is held is said thirty times a second while it is held, and once when it no longer is. A page that is hidden,
// or whose window or focus is lost, holds nothing any more; whatever is then still pressed has to be pressed again.
"use strict";
{
  const PERIOD_MS = 33, LATE_MS = 500, MOST_WAITING_BYTES = 2000, DEAD_ZONE = 0.15;
  // W is away from whoever looks as the first view does, which is from beyond the table towards the robot.
  const KEYS = {
    KeyW: ["x", -1], KeyS: ["x", 1], KeyA: ["y", -1], KeyD: ["y", 1], KeyR: ["z", 1], KeyF: ["z", -1],
    KeyQ: ["yaw", 1], KeyE: ["yaw", -1], KeyH: ["grip", 1], KeyG: ["grip", -1],
  };
  const AXES = ["x", "y", "z"];
  const NO_TEXT = ["range", "checkbox", "radio", "button", "submit", "reset", "color", "file"];

  const panel = document.getElementById("dp-jog");
  const says = document.getElementById("dp-jog-says");
  const place = document.getElementById("dp-jog-at");
  const speed = document.getElementById("dp-jog-speed");
  const keys = new Map(), pointers = new Map(), ours = new Set();
  let pad = null, padSpent = true, padSeen = false;
  let active = false, held = false, pressed = 0, sequence = 0;
  let socket = null, key = null, heardAt = 0, pressedAt = 0;

  const now = () => performance.now();
  const teleoperating = () => document.querySelector(".dp-mode")?.dataset.mode === "teleoperate";
  const ourKey = () => document.querySelector("[data-key]")?.dataset.key ?? null;

  function say(text, tone = "") {
    says.textContent = text;
    says.className = tone;
  }

  function open() {
    key = ourKey();
    if (key === null) return;
    const line = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/jog`);
    socket = line;
    line.addEventListener("open", () => line.send(key));
    line.addEventListener("message", (event) => {
      heardAt = now();
      if (line !== socket) return;
      const { says: said, at } = JSON.parse(event.data);
      say(said, said === "moving" ? "dp-good" : held ? "dp-warn" : "");
      place.textContent = `${AXES.map((axis, i) => `${axis} ${(1000 * at[i]).toFixed(0)}`).join("  ")} mm`;
    });
    line.addEventListener("close", () => {
      if (line !== socket) return;
      socket = null;
      if (held) say("The connection was lost: release and press again.", "dp-bad");
      letGo();
    });
  }

  function hangUp() {
    const line = socket;
    socket = null;
    line?.close();
  }

  // Presses are numbered here, so that the program can tell a new one from one that went on.
  function changed() {
    const holds = keys.size > 0 || pointers.size > 0 || pad !== null;
    if (holds === held) return;
    held = holds;
    if (held) {
      pressed += 1;
      pressedAt = now();
    }
    send();
  }

  function letGo() {
    keys.clear();
    pointers.clear();
    padSpent ||= pad !== null;
    pad = null;
    changed();
  }

  function send() {
    if (socket?.readyState !== WebSocket.OPEN) {
      if (held) say("Not connected yet: release and press again.", "dp-bad");
      return;
    }
    if (socket.bufferedAmount > MOST_WAITING_BYTES) {
      // What waits here would arrive late, and all at once.
      hangUp();
      say("The network is too slow: release and press again.", "dp-bad");
      return letGo();
    }
    const chosen = panel.querySelector("input[name=dp-jog-frame]:checked");
    const sample = {
      axes: axes(), held, pressed, sequence: sequence++, speed: speed.valueAsNumber / 100, frame: chosen.value,
      towards: [...pointers.values()].some((button) => "towards" in button.dataset),
    };
    if (held && now() - Math.max(heardAt, pressedAt) > LATE_MS) say("No answer from the program.", "dp-bad");
    socket.send(JSON.stringify(sample));
  }

  function axes() {
    const sum = { x: 0, y: 0, z: 0, yaw: 0, grip: 0, ...pad };
    for (const [axis, sign] of keys.values()) sum[axis] += sign;
    for (const { dataset } of pointers.values()) if (dataset.axis) sum[dataset.axis] += Number(dataset.sign);
    for (const axis in sum) sum[axis] = Math.max(-1, Math.min(1, sum[axis]));
    return sum;
  }

  function readPad() {
    if (!document.hasFocus() || document.hidden) {
      padSpent = true;  // What is held when the page comes back was not pressed there.
      return null;
    }
    const all = [...(navigator.getGamepads?.() ?? [])];
    const known = all.filter((one) => one?.mapping === "standard");
    const gripped = known.find((one) => one.buttons[4].pressed || one.buttons[5].pressed);
    if (known.length > 0 && !padSeen) say("A gamepad: hold a shoulder button, and move the sticks.");
    padSeen = known.length > 0;
    if (!gripped && known.length > 0) padSpent = false;
    if (!gripped || padSpent) return null;
    const [right, back, turn, down] = gripped.axes.map(beyond);
    return { x: back, y: right, z: -down, yaw: -turn, grip: gripped.buttons[7].value - gripped.buttons[6].value };
  }

  const beyond = (value) => (Math.sign(value) * Math.max(0, Math.abs(value) - DEAD_ZONE)) / (1 - DEAD_ZONE);

  function typing() {
    const at = document.activeElement;
    if (!at) return false;
    if (at.tagName === "INPUT") return !NO_TEXT.includes(at.type);
    return at.isContentEditable || at.tagName === "TEXTAREA" || at.tagName === "SELECT";
  }

  function tick() {
    if (teleoperating() !== active) {
      active = !active;
      panel.hidden = !active;
      if (!active) letGo();
      padSpent = true;
      say(active ? "Hold a key or a button." : "");
    }
    if (!active || (socket && key !== ourKey())) {
      letGo();
      hangUp();
    }
    if (!active) return;
    if (socket === null) open();
    pad = readPad();
    const before = held;
    changed();
    if (held && before) send();
  }

  // Viser turns its camera by some of these keys: while they move the tool it does not hear of them.
  function swallow(event) {
    event.preventDefault();
    event.stopImmediatePropagation();
  }

  function keyDown(event) {
    if (event.key === "Escape") return letGo();
    if (!active || !(event.code in KEYS) || event.ctrlKey || event.altKey || event.metaKey || typing()) return;
    if (event.repeat) return ours.has(event.code) && swallow(event);
    swallow(event);
    ours.add(event.code);
    keys.set(event.code, KEYS[event.code]);
    changed();
  }

  function keyUp(event) {
    if (ours.delete(event.code)) swallow(event);
    keys.delete(event.code);
    changed();
  }

  function pointerDown(event) {
    const button = event.target.closest("[data-axis], [data-towards]");
    if (!active || !button || event.button !== 0) return;
    button.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, button);
    changed();
  }

  function pointerGone(event) {
    if (pointers.delete(event.pointerId)) changed();
  }

  window.addEventListener("keydown", keyDown, { capture: true });
  window.addEventListener("keyup", keyUp, { capture: true });
  panel.addEventListener("pointerdown", pointerDown);
  panel.addEventListener("contextmenu", (event) => event.preventDefault());
  // A choice that keeps the focus would take the keys.
  panel.addEventListener("change", (event) => event.target.blur());
  for (const gone of ["pointerup", "pointercancel", "lostpointercapture"]) {
    window.addEventListener(gone, pointerGone, { capture: true });
  }
  for (const lost of ["blur", "pagehide"]) window.addEventListener(lost, letGo);
  document.addEventListener("visibilitychange", () => document.hidden && letGo());
  document.addEventListener("focusin", () => typing() && letGo());
  setInterval(tick, PERIOD_MS);
}
