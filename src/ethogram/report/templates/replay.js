// Plays recorded scenes. It reads what a page holds, keeps the time, and lets a stage draw:
// `planeStage` or `spaceStage`. It knows no world.
(() => {
  const SPEEDS = [0.25, 0.5, 1, 2, 4, 8];
  const HALF = 32767;
  const LANES = ["#009e73", "#cc79a7", "#a87400", "#7b4fb5", "#2b8ca3", "#7d7d7d"]; // in space
  const MARKS = "ABCDEFGHIJ"; // of scenes side by side, as many as a page can have
  const root = document.getElementById("replay");
  const scenes = JSON.parse(document.getElementById("replay-scenes").textContent);
  const part = name => root.querySelector(`[data-part="${name}"]`);
  const flat = part("canvas"), solid = part("space");
  const slider = part("frame"), play = part("play"), caption = part("caption"), clock = part("clock");
  const legend = part("legend"), choice = part("scene"), trial = part("trial");
  const chapter = part("chapter"), beside = part("beside"), follow = part("follow");
  const speed = part("speed"), loop = part("loop"), error = part("error");
  const thinned = part("thinned");
  const still = matchMedia("(prefers-reduced-motion: reduce)");
  const laneColour = lane => LANES[lane % LANES.length];
  const names = [...new Set(scenes.map(each => each.name))];
  const spaceOnly = document.querySelectorAll("[data-only=space]");
  const motionOnly = document.querySelectorAll("[data-only=motion]");
  const stages = {}, read = new Map();
  let cast = [], stage = null, frames = 0, frame = 0, playing = false, last = 0, owed = 0;
  let asked = 0, look = null;

  function theme() {
    if (look) return look;
    const style = getComputedStyle(root);
    const value = name => style.getPropertyValue(`--${name}`).trim();
    look = { ink: value("ink"), paper: value("paper"), muted: value("muted"), rule: value("rule"),
      wash: value("wash") };
    return look;
  }

  const chart = chartOf(part("chart"), part("lines"), theme);

  const bytesOf = text => Uint8Array.from(atob(text), letter => letter.charCodeAt(0));

  // Steps of each number's own range, its low and the size of a step; or whole numbers.
  async function numbers(stored, length, frames) {
    const bytes = bytesOf(stored.data);
    const ranges = stored.ranges && new DataView(bytesOf(stored.ranges).buffer);
    const low = place => ranges.getFloat32(4 * place, true);
    const size = place => ranges.getFloat32(4 * (length + place), true);
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    const steps = new DataView(await new Response(stream).arrayBuffer());
    if (steps.byteLength !== 2 * length * frames) throw new Error("its numbers are cut short");
    const found = new Float32Array(length * frames), at = new Int16Array(length);
    for (let index = 0; index < found.length; index++) {
      const place = index % length;
      at[place] += steps.getInt16(2 * index, true);
      if (!ranges) found[index] = at[place];
      else if (at[place] === -HALF - 1) found[index] = NaN;
      else found[index] = low(place) + (at[place] + HALF) * size(place);
    }
    return found;
  }

  // The arrays of a scene, which are unpacked once.
  async function unpacked(scene) {
    if (scene.error !== undefined) throw new Error(scene.error);
    if (!(scene.frames > 0)) throw new Error("it has no frame");
    if (!scene.shapes.length) throw new Error("it has no shapes");
    if (read.has(scene)) return read.get(scene);
    const count = scene.shapes.length;
    const lengths = {
      position: scene.axes * count, tint: count, said: count, scale: count, fresh: count,
      orientation: 4 * count, heading: count, vertices: 2 * scene.vertices * count,
      series: lineCount(scene),
    };
    const arrays = {};
    for (const [name, stored] of Object.entries(scene.arrays))
      arrays[name] = await numbers(stored, lengths[name], scene.frames);
    read.set(scene, arrays);
    return arrays;
  }

  const lineCount = scene => scene.lines.reduce((sum, [, number]) => sum + number, 0);
  const named = name => scenes.filter(each => each.name === name);

  function stageFor(scene) {
    const solidly = scene.axes === 3;
    flat.hidden = solidly;
    solid.hidden = !solidly;
    for (const each of spaceOnly) each.hidden = !solidly;
    if (!solidly) return stages.plane ??= planeStage(flat, theme);
    if (stages.space) return stages.space;
    try {
      stages.space = spaceStage(solid, theme, laneColour);
    } catch {
      throw new Error("pictures in space need WebGL, which this browser does not offer");
    }
    stages.space.whenTurned(() => { if (!playing) paint(0); });
    return stages.space;
  }

  // Shows the chosen scene, and those beside it.
  async function show() {
    stop();
    const turn = ++asked; // a later choice may be ready before this one
    const chosen = [named(choice.value)[trial.selectedIndex] ?? scenes[0]];
    for (const box of beside.querySelectorAll("input:checked")) chosen.push(scenes[box.value]);
    const found = [];
    let reason = null;
    try {
      for (const scene of chosen)
        found.push({ scene, arrays: await unpacked(scene), mark: MARKS[found.length] });
      if (turn !== asked) return;
      stop(); // it may have been started meanwhile
      stage = stageFor(chosen[0]);
      stage.show(found);
      cast = found;
    } catch (trouble) {
      if (turn !== asked) return;
      cast = [];
      stage = null;
      for (const each of [flat, solid, ...spaceOnly]) each.hidden = true;
      reason = trouble.message;
    }
    error.hidden = reason === null;
    error.textContent = reason === null ? "" : `This replay cannot be shown: ${reason}.`;
    frames = Math.max(0, ...cast.map(each => each.scene.frames));
    slider.max = Math.max(0, frames - 1);
    for (const each of motionOnly) each.hidden = frames < 2;
    root.dataset.frames = frames;
    chart.show(cast, frames, laneColour);
    describe();
    go(0);
  }

  function describe() {
    legend.replaceChildren();
    const add = (swatch, text) => {
      const item = document.createElement("li"), spot = document.createElement("span");
      spot.className = "swatch";
      spot.style.background = swatch;
      const words = document.createElement("span");
      words.textContent = text;
      words.dir = "auto";
      item.append(spot, words);
      legend.append(item);
    };
    if (!cast.length) return;
    for (const [meaning, colour] of cast[0].scene.palette) add(colour, meaning);
    if (cast.length > 1)
      cast.forEach(({ scene, mark }, lane) => add(laneColour(lane), `${mark}: ${titled(scene)}`));
    thinned.replaceChildren(...cast.flatMap(({ scene, mark }) => {
      if (!scene.thinned) return [];
      const [all, step] = scene.thinned, which = cast.length > 1 ? `${mark}: ` : "";
      return `${which}of ${all} frames every ${nth(step)} is shown; a video (MP4) has them all. `;
    }));
    thinned.hidden = !thinned.hasChildNodes();
    const marks = cast.length === 1 ? cast[0].scene.chapters : [];
    chapter.replaceChildren(...marks.map(([first, name]) => new Option(name, first)));
    chapter.closest("label").hidden = marks.length < 2;
    part("ticks").replaceChildren(...marks.map(([first]) => new Option("", first)));
  }

  const nth = step => step + (["th", "st", "nd", "rd"][
    step % 100 > 10 && step % 100 < 14 ? 0 : step % 10] ?? "th");
  const titled = ({ name, trial }) => name + (trial > 1 ? `, trial ${trial}` : "");

  const paint = share => { if (cast.length) stage.draw(frame, still.matches ? 0 : share); };

  // What the caption says; side by side, of each.
  function moment() {
    const said = cast.map(({ scene, mark }) => {
      const words = scene.captions[Math.min(frame, scene.frames - 1)] ?? "";
      return cast.length > 1 ? `${mark} ${words}` : words;
    });
    return said.join("; ");
  }

  function go(to, share = 0) {
    frame = Math.max(0, Math.min(Math.max(0, frames - 1), to));
    const words = moment();
    slider.value = frame;
    slider.setAttribute("aria-valuetext", words);
    root.dataset.frame = frame;
    caption.textContent = words;
    const second = at => (at * (cast[0]?.scene.seconds ?? 0)).toFixed(1);
    clock.textContent = `${second(frame)} of ${second(Math.max(0, frames - 1))} s`;
    if (chapter.options.length > 1) {
      const marks = cast[0].scene.chapters;
      chapter.selectedIndex = marks.findLastIndex(([first]) => first <= frame);
    }
    paint(share);
    chart.draw(frame);
  }

  function start() {
    if (!cast.length) return;
    if (frame === frames - 1) go(0);
    playing = true;
    last = performance.now();
    owed = 0;
    play.textContent = "Pause";
    requestAnimationFrame(tick);
  }

  function stop() {
    const moved = playing;
    playing = false;
    play.textContent = "Play";
    if (moved) paint(0);
  }

  function tick(now) {
    if (!playing || !cast.length) return;
    const passed = Math.max(0, now - last) / 1000; // the first frame may have begun before the click
    owed += passed * SPEEDS[speed.selectedIndex] / cast[0].scene.seconds;
    last = now;
    const steps = Math.floor(owed);
    owed -= steps;
    if (steps > 0) {
      const to = frame + steps;
      if (to > frames - 1 && loop.checked) go(to % frames, owed);
      else go(to, owed);
      if (frame === frames - 1 && !loop.checked) return stop();
    } else paint(owed);
    requestAnimationFrame(tick);
  }

  const toggle = () => (playing ? stop() : start());
  const step = by => { stop(); go(frame + by); };
  const keys = {
    " ": toggle, k: toggle,
    ArrowRight: () => step(1), ArrowLeft: () => step(-1),
    PageDown: () => step(10), PageUp: () => step(-10),
    Home: () => step(-Infinity), End: () => step(Infinity),
  };

  function pressed(event) {
    const control = event.target.closest("button, select, summary, input[type=checkbox]");
    if (control && [" ", "Enter"].includes(event.key) || event.target.matches("select")) return;
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const act = keys[event.key] ?? (stage === stages.space && stage?.keys[event.key]);
    if (!act) return;
    event.preventDefault();
    act();
    if (!(event.key in keys)) paint(0);
  }

  // The trials of the chosen case, and the cases that can stand beside it.
  function chosen() {
    const same = named(choice.value);
    trial.replaceChildren(...same.map(each => new Option(each.trial ?? 1)));
    trial.closest("label").hidden = same.length < 2;
    const others = scenes.filter(each => each.axes === 3 && !same.includes(each));
    beside.closest("details").hidden = same[0]?.axes !== 3 || others.length === 0;
    beside.replaceChildren(...others.map(each => {
      const label = document.createElement("label"), box = document.createElement("input");
      box.type = "checkbox";
      box.value = scenes.indexOf(each);
      label.append(box, ` ${titled(each)}`);
      label.dir = "auto";
      return label;
    }));
    show();
  }

  play.addEventListener("click", toggle);
  part("back").addEventListener("click", () => step(-1));
  part("on").addEventListener("click", () => step(1));
  slider.addEventListener("input", () => { stop(); go(Number(slider.value)); });
  choice.addEventListener("change", chosen);
  for (const each of [trial, beside]) each.addEventListener("change", show);
  chapter.addEventListener("change", () => { stop(); go(Number(chapter.value)); });
  follow.addEventListener("change", () => { stages.space?.follow(follow.checked); paint(0); });
  root.addEventListener("keydown", pressed);
  solid.addEventListener("focus", () => stages.space?.zoom(true));
  solid.addEventListener("blur", () => stages.space?.zoom(false));
  solid.addEventListener("pointerdown", () => solid.focus({ preventScroll: true }));
  const redraw = () => { look = null; if (cast.length) { stage.restyle?.(); go(frame); } };
  const resized = new ResizeObserver(() => go(frame));
  for (const each of [flat, solid]) resized.observe(each);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  choice.replaceChildren(...names.map(name => new Option(name)));
  SPEEDS.forEach(each => speed.add(new Option(`${each} ×`)));
  speed.selectedIndex = SPEEDS.indexOf(1);
  root.hidden = false;
  chosen();
})();
