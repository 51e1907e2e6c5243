// What the widgets of a notebook's cell show, and which controls they have; it knows nothing of what the controls mean.
globalThis.secLabControls ??= (() => {
  const KINDS = {
    picture: "canvas.sec-lab-picture, .sec-lab-clickable",
    slider: ".widget-slider",
    toggles: ".widget-toggle-buttons",
    dropdown: ".widget-dropdown",
    list: ".widget-select-multiple",
    checkbox: ".widget-checkbox",
    play: ".widget-play",
    number: ".widget-text:has(input[type=number])",
    text: ".widget-text:has(input[type=text])",
    upload: ".sec-lab-upload",
    button: "button.widget-button",
  };
  const BAR = ".widget-hprogress";
  const ALERT = ".sec-lab-alert";
  const SHOWN = "canvas.sec-lab-picture, .sec-lab-drawing, .widget-html-content, .jupyter-widgets.widget-label";
  const QUIET_MS = 60, GRACE_MS = 200, SOON_MS = 2_000, PATIENCE_MS = 60_000;

  const isVisible = (node) => node.checkVisibility({ visibilityProperty: true });
  const visible = (cell, what) => [...cell.querySelectorAll(what)].filter(isVisible);
  const isAtWork = (cell) => visible(cell, BAR).length > 0;
  const pause = (ms) => new Promise((done) => setTimeout(done, ms));
  const hashes = new WeakMap();

  // Pixels as one number, which is kept until something else is drawn.
  function pixels(canvas) {
    const [drawn, known] = hashes.get(canvas) ?? [];
    if (drawn === canvas.dataset.drawn) return known;
    let hash = 0;
    if (canvas.width && canvas.height) {
      const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
      for (const pixel of new Uint32Array(data.buffer)) hash = (Math.imul(hash, 31) + pixel) | 0;
    }
    hashes.set(canvas, [canvas.dataset.drawn, hash]);
    return hash;
  }
  const content = (node) => (node.tagName === "CANVAS" ? pixels(node) : node.innerHTML);
  const shown = (cell) => visible(cell, SHOWN).map(content).join("\0");
  const alerts = (cell) => visible(cell, ALERT).map((node) => node.textContent);

  function nameOf(node) {
    const drawing = node.querySelector("svg");
    const names = [
      drawing?.getAttribute("aria-label"), node.ariaLabel, node.querySelector("[placeholder]")?.placeholder,
      ...[...node.querySelectorAll("label")].map((label) => label.textContent), node.querySelector("span")?.textContent,
      node.matches("button") ? node.textContent || node.title : "",
    ];
    return names.map((name) => (name ?? "").replace("\u200b", "").trim()).find(Boolean) ?? "";
  }
  function stateOf(node) {
    const parts = [node, ...node.querySelectorAll("[aria-valuenow], input, option, button")];
    return JSON.stringify(parts.map((part) => [
      part.ariaValueText, part.value, part.checked, part.selected, part.disabled, part.classList.contains("mod-active"),
    ]));
  }
  function controls(cell) {
    return visible(cell, Object.values(KINDS).join()).map((node) => {
      const kind = Object.keys(KINDS).find((one) => node.matches(KINDS[one]));
      const isEnabled = !node.matches(":disabled") && !node.querySelector("[disabled], :disabled:not(option)");
      node.dataset.control ??= crypto.randomUUID();
      return { id: node.dataset.control, kind, name: nameOf(node) || kind, isEnabled, hint: node.title };
    });
  }

  // What widgets have told the kernel, until it has done all that they asked for.
  const told = new Set();
  jupyterapp.shell.currentWidget.sessionContext.session.kernel.anyMessage.connect((_, { msg, direction }) => {
    if (direction === "send" && msg.header.msg_type === "comm_msg") told.add(msg.header.msg_id);
    if (msg.content.execution_state === "idle") told.delete(msg.parent_header.msg_id);
  });
  async function answer() {
    const late = performance.now() + PATIENCE_MS;
    do {
      if (performance.now() > late) throw new Error("the kernel does not answer");
      await pause(5);
    } while (told.size);
  }
  async function until(cell, isIt, ms) {
    if (isIt()) return true;
    return new Promise((done) => {
      const end = (is) => { seen.disconnect(); clearTimeout(late); done(is); };
      const seen = new MutationObserver(() => isIt() && end(true));
      const late = setTimeout(() => end(isIt()), ms);
      seen.observe(cell, { subtree: true, childList: true, attributes: true, characterData: true });
    });
  }
  async function rest(cell) {
    let last = null;
    for (let now = shown(cell); now !== last || told.size || isAtWork(cell); now = shown(cell)) {
      last = now;
      await answer();
      if (!(await until(cell, () => !isAtWork(cell), PATIENCE_MS))) throw new Error("the progress bar stays");
      await pause(QUIET_MS);
    }
  }

  let before = {};
  for (const kind of ["pointerdown", "keydown", "input"]) {
    // What the page shows is timed from the last touch before it changes.
    document.addEventListener(kind, () => { if (!before.seen) before.begin = performance.now(); }, true);
  }
  function look(cell, node) {
    const now = { shown: shown(cell), state: stateOf(node), alerts: alerts(cell), begin: performance.now(), seen: 0 };
    before = now;
    until(cell, () => shown(cell) !== now.shown || isAtWork(cell), PATIENCE_MS).then(() => { now.seen = performance.now(); });
  }
  const hasChanged = (cell) => shown(cell) !== before.shown;
  const changes = (cell, ms) => until(cell, () => hasChanged(cell), ms);
  // Presses the button that cancels, if there is work; gives it if the work then ends soon and shows nothing of its aim.
  async function cancel(cell) {
    await answer();
    const found = controls(cell).find(({ name }) => name.toLowerCase() === "cancel");
    if (!found) return null;
    const begin = performance.now();
    cell.querySelector(`[data-control="${found.id}"]`).click();
    const isSoon = await until(cell, () => !isAtWork(cell), SOON_MS);
    const ms = performance.now() - begin;
    await rest(cell);
    return isSoon && (!hasChanged(cell) || shown(cell).includes("Stopped")) ? { ...found, ms } : null;
  }
  async function after(cell, node, hasState) {
    await rest(cell);
    const isMoved = !hasState || stateOf(node) !== before.state;
    if (isMoved && !hasChanged(cell) && (await changes(cell, GRACE_MS))) await rest(cell);
    const isFollowed = hasChanged(cell);
    return {
      isMoved, isFollowed, ms: isFollowed ? before.seen - before.begin : 0,
      said: alerts(cell).filter((words) => !before.alerts.includes(words)),
      words: visible(cell, SHOWN).map((one) => one.textContent).join("\n"),
    };
  }
  return { controls, look, after, changes, cancel, rest };
})();
