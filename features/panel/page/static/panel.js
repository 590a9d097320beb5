// The panel's own script: hold-to-jog by beats, the emergency stop, and the numbers that change many times a second.
(() => {
  const BEAT_MS = 80; // the server lets a jog end 250 ms after its last beat
  const tell = (name, value) => window.emitEvent(name, value);

  // --- the state that is shown: each event that the page sends names the newest one, so that its age is known

  let shown = null;

  function nameShown(socket) {
    const emit = socket.emit.bind(socket);
    socket.emit = (name, message, ...rest) => {
      if (name === "event") message.shown = shown;
      return emit(name, message, ...rest);
    };
  }

  const silent = () => document.body.classList.contains("silent"); // nothing comes from the panel
  const unseen = () => silent() || document.querySelector(".unseen") !== null; // or nothing from the machine

  // Buttons that move the machine are dead while it is not seen.
  document.addEventListener(
    "click",
    (event) => {
      if (!unseen() || !event.target.closest?.("[data-moves], [data-what]")) return;
      event.preventDefault();
      event.stopImmediatePropagation();
    },
    true,
  );

  // --- stops: on two ways at once, again and again until one of them is answered

  const AGAIN_MS = 250;
  const UNANSWERED_MS = 300;
  const GIVEN_UP_MS = 1000;
  const OBEYED_MS = 1000;
  const OWN_SWITCH = "use the machine's own switch";
  const STOPS = { emergency_stop: "E-STOP", stop: "Stop" };
  let held = false; // whether an emergency stop holds the machine
  let stop = null; // the last press: { kind, name, began, answered, told, obeyed }, times in ms
  let lastPointer = -Infinity;

  function pressStop(kind, event) {
    event?.preventDefault();
    releaseAll();
    if (!stop || stop.answered || stop.kind !== kind) {
      const name = `${Date.now()}-${Math.random().toString(36).slice(2)}`;
      stop = { kind, name, began: performance.now(), told: false };
      sendAgain(stop);
      setTimeout(sayStop, UNANSWERED_MS);
    } else sendStop(stop);
    sayStop();
  }

  function sendAgain(press) {
    if (press.answered) return;
    sendStop(press);
    setTimeout(() => sendAgain(press), AGAIN_MS);
  }

  function sendStop(press) {
    const { kind, name } = press;
    window.socket?.timeout(GIVEN_UP_MS).emit(kind, name, (error, answer) => error || answered(press, answer));
    const query = new URLSearchParams({ press: name, page: window.clientId ?? "" });
    fetch(`/${kind}?${query}`, { method: "POST", keepalive: true, signal: AbortSignal.timeout(GIVEN_UP_MS) })
      .then((response) => response.ok && response.json())
      .then((answer) => answer && answered(press, answer))
      .catch(() => {}); // it is sent again
  }

  function answered(press, answer) {
    press.answered ??= performance.now();
    press.told ||= answer.told;
    if (press.kind === "stop" && press.told) obeyed(press);
    sayStop();
  }

  function obeyed(press) {
    if (press?.answered) press.obeyed ??= performance.now();
  }

  function stopWords(now) {
    if (!stop || stop.obeyed) {
      if (stop?.kind === "emergency_stop" && held)
        return ["Emergency stop obeyed: all drives are off and held.", "good"];
      return silent()
        ? [`No connection to the panel: what is shown is old. E-STOP may not work: ${OWN_SWITCH}.`, "bad"]
        : ["", ""];
    }
    const button = STOPS[stop.kind];
    if (!stop.answered && now - stop.began < UNANSWERED_MS) return [`${button}: sent.`, "warn"];
    if (!stop.answered) return [`${button}: no connection: this button does not work, ${OWN_SWITCH}.`, "bad"];
    if (!stop.told) return [`${button}: the panel has no connection to the machine: ${OWN_SWITCH}.`, "bad"];
    if (now - stop.answered < OBEYED_MS) return [`${button}: the machine is told.`, "warn"];
    return [`${button}: the machine has not obeyed: ${OWN_SWITCH}.`, "bad"];
  }

  function sayStop() {
    const line = document.querySelector("[data-stop-line]");
    const [text, tone] = stopWords(performance.now());
    if (line && line.textContent !== text) {
      line.textContent = text;
      line.dataset.tone = tone;
    }
  }

  const stopOf = (event) => event.target.closest?.("[data-stop]")?.dataset.stop;

  window.addEventListener(
    "keydown",
    (event) => {
      if (event.key === "Escape" && !event.repeat) pressStop("emergency_stop", event);
    },
    true,
  );
  document.addEventListener("pointerdown", (event) => {
    const kind = stopOf(event);
    if (!kind) return;
    lastPointer = performance.now();
    pressStop(kind, event);
  });
  document.addEventListener("click", (event) => {
    // by a key, or by a screen reader, which tells of no pointer
    const kind = stopOf(event);
    if (kind && performance.now() - lastPointer > 1000) pressStop(kind, event);
  });

  // --- hold to jog: a press has an id; whatever ends it, ends it for good

  let press = null;
  let number = 0;

  function begin(button, event) {
    if (press || unseen() || button.disabled || button.getAttribute("aria-disabled") === "true") return;
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
  const SILENT_MS = 400; // and the next look: together half a second
  const LOOK_MS = 100;
  const title = document.title; // where another window is in front, the tab tells the progress
  let lastTick = performance.now();
  let lastLook = performance.now();

  function setSilent(now) {
    const classes = document.body.classList; // even a change to what is there already would be told to all observers
    if (silent() !== now) classes.toggle("silent", now);
    if (now) releaseAll();
    sayStop();
  }

  // Words and buttons come as NiceGUI's own messages. Where one of them was lost, as while the connection was made again,
  // the page is loaded again: it must not show who operated, or what was in the way, some time ago. `due` is the number of
  // a change that was sent to this page seconds ago, before this message. It asks once: another request would end the first,
  // and where the answer takes longer than the next message, the page would ask for ever.
  let loadsAgain = false;
  function alive(due) {
    lastTick = performance.now();
    const shownChange = document.querySelector("[data-revision]")?.dataset.revision;
    if (!loadsAgain && shownChange !== undefined && Number(shownChange) < due) {
      loadsAgain = true;
      window.location.reload();
    }
    setSilent(false);
  }

  function tick(now, due) {
    alive(due);
    shown = now.n;
    held = now.held;
    if (held && stop?.kind === "emergency_stop") obeyed(stop);
    const values = { load: fixed(now.load, 1), fill: fixed(now.fill, 0), late: fixed(now.late, 1) };
    now.q.forEach((value, i) => (values[`q${i}`] = now.known[i] ? fixed(value, 3) : "unknown"));
    now.v.forEach((value, i) => (values[`v${i}`] = fixed(value, 2)));
    now.e.forEach((value, i) => (values[`e${i}`] = fixed(value, 3)));
    for (const { dataset } of document.querySelectorAll("[data-live^=pose]")) values[dataset.live] = "–"; // unknown
    now.pose?.forEach((value, i) => (values[`pose${i}`] = fixed(value, 2)));
    write(values);
    for (const bar of document.querySelectorAll("[data-part]")) bar.style.width = `${100 * (now.part ?? 0)}%`;
    const percent = now.part ? `${Math.round(100 * now.part)} % – ` : "";
    if (document.title !== percent + title) document.title = percent + title;
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

  window.withdrawErrors = () => {
    for (const note of document.querySelectorAll(".q-notification.bg-negative")) note.style.display = "none";
  };

  // A server that has stopped sending is as good as a machine that is not seen: grey everything. A page that was held up
  // itself has not looked at what has come meanwhile: that is no silence.
  setInterval(() => {
    const now = performance.now();
    const heldUp = now - lastLook > 2 * LOOK_MS;
    lastLook = now;
    if (!heldUp && now - lastTick > SILENT_MS) setSilent(true);
    else sayStop();
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

  // --- the tab that was open last is so again after a reload

  const TAB = "steptwin-tab";
  document.addEventListener("click", (event) => {
    const tab = event.target.closest?.(".q-tab");
    if (tab) sessionStorage.setItem(TAB, tab.innerText.trim());
  });
  function openLastTab() {
    const last = sessionStorage.getItem(TAB);
    if (last) [...document.querySelectorAll(".q-tab")].find((tab) => tab.innerText.trim() === last)?.click();
  }

  // Beside NiceGUI's own messages, so that none is sent again after a lost connection: only the newest one counts.
  let heard = null;
  setInterval(() => {
    if (!window.socket || window.socket === heard) return;
    heard = window.socket;
    nameShown(heard);
    heard.on("alive", (_, due) => alive(due));
    heard.on("tick", (text, due) => tick(JSON.parse(text), due));
    heard.on("disconnect", () => setSilent(true));
    heard.once("tick", openLastTab);
  }, 50);
})();
