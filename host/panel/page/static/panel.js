// The panel's own script: hold-to-jog by beats, the emergency stop, and the numbers that change many times a second.
(() => {
  const BEAT_MS = 80; // the server lets a jog end 250 ms after its last beat
  const tell = (name, value) => window.emitEvent(name, value);

  // --- emergency stop: by its button or Esc, over the socket, else by a request of its own

  function emergencyStop(event) {
    event?.preventDefault();
    if (window.socket?.connected && window.did_handshake) tell("emergency_stop", {});
    else fetch("/emergency-stop", { method: "POST", keepalive: true }).catch(() => {});
    releaseAll();
  }

  window.addEventListener(
    "keydown",
    (event) => {
      if (event.key === "Escape" && !event.repeat) emergencyStop(event);
    },
    true,
  );
  document.addEventListener("pointerdown", (event) => {
    if (event.target.closest?.("[data-estop]")) emergencyStop(event);
  });
  document.addEventListener("keydown", (event) => {
    const pressed = event.key === "Enter" || event.key === " ";
    if (pressed && !event.repeat && event.target.closest?.("[data-estop]")) emergencyStop(event);
  });

  // --- hold to jog: a press has an id; whatever ends it, ends it for good

  let press = null;
  let number = 0;

  function begin(button, event) {
    if (press || button.disabled || button.getAttribute("aria-disabled") === "true") return;
    number = Math.max(Date.now(), number + 1); // counts up beyond a reload, too
    press = { id: number, button };
    button.classList.add("held");
    const jog = JSON.parse(button.dataset.jog);
    const beat = () => tell("jog_beat", { press: press.id, ...jog });
    beat();
    press.timer = setInterval(beat, BEAT_MS);
    if (event.pointerId !== undefined && button.hasPointerCapture?.(event.pointerId)) {
      button.releasePointerCapture(event.pointerId); // a finger that leaves the button shall let go of it
    }
  }

  function releaseAll() {
    if (!press) return;
    const { id, button, timer } = press;
    press = null;
    clearInterval(timer);
    button.classList.remove("held");
    tell("jog_release", { press: id });
  }

  const jogButton = (event) => event.target.closest?.("[data-jog]");
  document.addEventListener("pointerdown", (event) => {
    const button = jogButton(event);
    if (button && event.button === 0) begin(button, event);
  });
  document.addEventListener("keydown", (event) => {
    const button = jogButton(event);
    if (!button || (event.key !== " " && event.key !== "Enter")) return;
    event.preventDefault();
    if (!event.repeat) begin(button, event);
  });
  for (const name of ["pointerup", "pointercancel", "keyup", "contextmenu", "dragstart"]) {
    document.addEventListener(name, releaseAll, true);
  }
  document.addEventListener(
    "pointermove",
    (event) => {
      if (press && event.pointerType !== "" && !press.button.contains(document.elementFromPoint(event.clientX, event.clientY)))
        releaseAll();
    },
    true,
  );
  document.addEventListener("pointerout", (event) => {
    if (press && press.button.contains(event.target) && !press.button.contains(event.relatedTarget)) releaseAll();
  });
  for (const name of ["blur", "pagehide", "beforeunload"]) window.addEventListener(name, releaseAll);
  document.addEventListener("visibilitychange", () => document.hidden && releaseAll());
  document.addEventListener("contextmenu", (event) => jogButton(event) && event.preventDefault());

  // --- the numbers: one message a tick, { t, q, known, v, e, pose, arm, tool, load, fill, late, part }

  function write(values) {
    for (const element of document.querySelectorAll("[data-live]")) {
      const text = values[element.dataset.live];
      if (text !== undefined && element.textContent !== text) element.textContent = text;
    }
  }

  const fixed = (value, decimals) => (value == null ? "–" : value.toFixed(decimals).replace(/^-(0\.?0*)$/, "$1"));
  const SILENT_MS = 450;
  const LOOK_MS = 100;
  let lastTick = performance.now();
  let lastLook = performance.now();

  function setSilent(silent) {
    const classes = document.body.classList; // even a change to what is there already would be told to all observers
    if (classes.contains("silent") !== silent) classes.toggle("silent", silent);
  }

  function tick(now) {
    lastTick = performance.now();
    setSilent(false);
    const values = { load: fixed(now.load, 1), fill: fixed(now.fill, 0), late: fixed(now.late, 1) };
    now.q.forEach((value, i) => (values[`q${i}`] = now.known[i] ? fixed(value, 3) : "unknown"));
    now.v.forEach((value, i) => (values[`v${i}`] = fixed(value, 2)));
    now.e.forEach((value, i) => (values[`e${i}`] = fixed(value, 3)));
    (now.pose ?? [null, null, null, null]).forEach((value, i) => (values[`pose${i}`] = fixed(value, 2)));
    write(values);
    for (const bar of document.querySelectorAll("[data-part]")) bar.style.width = `${100 * (now.part ?? 0)}%`;
    if (document.hidden) return;
    const scene = document.querySelector(".arm-scene")?.armScene;
    if (scene?.on && now.arm) {
      const arm = JSON.stringify(now.arm);
      if (arm !== scene.shown) scene.show("arm", now.arm);
      scene.shown = arm;
      if (now.tool) scene.trace(...now.tool);
    }
    document.querySelector(".live-plot")?.livePlot?.add(now.t, now.q, now.v, now.e);
  }

  // A server that has stopped sending is as good as a machine that is not seen: grey everything. A page that was held up
  // itself has not looked at what has come meanwhile: that is no silence.
  setInterval(() => {
    const now = performance.now();
    const heldUp = now - lastLook > 2 * LOOK_MS;
    lastLook = now;
    if (!heldUp && now - lastTick > SILENT_MS) setSilent(true);
  }, LOOK_MS);

  // --- light and dark: as the system has it, or as this browser was told

  function setTheme(chosen) {
    localStorage.setItem("steptwin-theme", chosen);
    window.Quasar.Dark.set(chosen === "dark");
  }

  window.addEventListener("load", () => {
    const chosen = localStorage.getItem("steptwin-theme");
    if (chosen) setTheme(chosen);
  });
  document.addEventListener("click", (event) => {
    if (event.target.closest?.("[data-theme-switch]"))
      setTheme(document.body.classList.contains("body--dark") ? "light" : "dark");
  });

  // Beside NiceGUI's own messages, so that none is sent again after a lost connection: only the newest one counts.
  let heard = null;
  setInterval(() => {
    if (!window.socket || window.socket === heard) return;
    heard = window.socket;
    heard.on("tick", (text) => tick(JSON.parse(text)));
    heard.on("disconnect", () => setSilent(true));
  }, 50);
})();
