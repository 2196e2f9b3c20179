"use strict";
// One player for every scene in the plane. It draws what a scene holds and knows no world.
(() => {
  const SPEEDS = [0.25, 0.5, 1, 2, 4, 8];
  const HALF = 32767;
  const root = document.getElementById("replay");
  const scenes = JSON.parse(document.getElementById("replay-scenes").textContent);
  const part = name => root.querySelector(`[data-part="${name}"]`);
  const canvas = part("canvas"), chart = part("chart"), slider = part("frame");
  const play = part("play"), caption = part("caption"), legend = part("legend");
  const choice = part("scene"), speed = part("speed"), loop = part("loop"), error = part("error");
  let scene = null, arrays = {}, frame = 0, playing = false, last = 0, owed = 0;

  async function numbers(stored, length, frames) {
    const bytes = Uint8Array.from(atob(stored.data), letter => letter.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    const steps = new DataView(await new Response(stream).arrayBuffer());
    if (steps.byteLength !== 2 * length * frames) throw new Error("its numbers are cut short");
    const found = new Float32Array(length * frames), at = new Int16Array(length);
    for (let index = 0; index < found.length; index++) {
      const place = index % length;
      at[place] += steps.getInt16(2 * index, true);
      found[index] = stored.low + (at[place] + HALF) * stored.step;
    }
    return found;
  }

  async function show(index) {
    stop();
    error.hidden = true;
    const chosen = scenes[index];
    let lines = 0;
    try {
      if (chosen.trouble !== undefined) throw new Error(chosen.trouble);
      const count = chosen.shapes.length;
      lines = chosen.lines.reduce((sum, [, number]) => sum + number, 0);
      const lengths = { position: 2 * count, tint: count, said: count, scale: count, series: lines };
      const loaded = {};
      for (const [name, stored] of Object.entries(chosen.arrays))
        loaded[name] = await numbers(stored, lengths[name], chosen.frames);
      if (!(chosen.frames > 0)) throw new Error("it has no frame");
      scene = chosen;
      arrays = loaded;
    } catch (reason) {
      scene = null;
      error.textContent = `This replay cannot be shown: ${reason.message}.`;
      error.hidden = false;
    }
    slider.max = scene ? scene.frames - 1 : 0;
    root.dataset.frames = scene ? scene.frames : 0;
    chart.hidden = !scene || lines === 0;
    if (scene) {
      const [left, bottom, right, top] = scene.bounds;
      canvas.style.aspectRatio = Math.min(4, Math.max(1, (right - left) / (top - bottom)));
    }
    describe();
    go(0);
  }

  function describe() {
    legend.replaceChildren();
    if (!scene) return;
    scene.palette.forEach((meaning, tint) => {
      const item = document.createElement("li"), swatch = document.createElement("span");
      swatch.className = "swatch";
      swatch.style.background = colour(tint);
      const text = document.createElement("span");
      text.textContent = meaning;
      text.dir = "auto";
      item.append(swatch, text);
      legend.append(item);
    });
  }

  const COLOURS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#a87400", "#7d7d7d"];
  const colour = tint => COLOURS[tint % COLOURS.length];
  const style = name => getComputedStyle(root).getPropertyValue(name).trim();

  // Fits the bounds into the canvas, the same scale on both axes, y upwards.
  function fit(surface) {
    const density = window.devicePixelRatio || 1, width = surface.clientWidth;
    const height = surface.clientHeight;
    if (surface.width !== Math.round(width * density)) surface.width = Math.round(width * density);
    if (surface.height !== Math.round(height * density))
      surface.height = Math.round(height * density);
    const pen = surface.getContext("2d");
    pen.setTransform(density, 0, 0, density, 0, 0);
    pen.clearRect(0, 0, width, height);
    return { pen, width, height };
  }

  function draw() {
    const { pen, width, height } = fit(canvas);
    if (!scene) return;
    const [left, bottom, right, top] = scene.bounds;
    const unit = Math.min(width / (right - left), height / (top - bottom));
    const x0 = (width - unit * (right - left)) / 2, y0 = (height - unit * (top - bottom)) / 2;
    const count = scene.shapes.length, first = frame * count;
    const x = shape => x0 + unit * (arrays.position[2 * (first + shape)] - left);
    const y = shape => y0 + unit * (top - arrays.position[2 * (first + shape) + 1]);
    const ink = style("--ink"), paper = style("--paper");
    pen.font = `${Math.max(10, Math.min(13, width / 50))}px sans-serif`;
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    pen.lineWidth = 1;
    pen.strokeStyle = style("--muted");
    for (const [one, other] of scene.links) {
      if (arrays.tint[first + one] < 0 || arrays.tint[first + other] < 0) continue;
      pen.beginPath();
      pen.moveTo(x(one), y(one));
      pen.lineTo(x(other), y(other));
      pen.stroke();
    }
    for (let shape = 0; shape < count; shape++) {
      const tint = Math.round(arrays.tint[first + shape]);
      if (tint < 0) continue;
      const [kind, size, label] = scene.shapes[shape];
      const radius = unit * size * (arrays.scale ? arrays.scale[first + shape] : 1);
      pen.fillStyle = pen.strokeStyle = colour(tint);
      pen.beginPath();
      if (kind === "square") pen.rect(x(shape) - radius, y(shape) - radius, 2 * radius, 2 * radius);
      else if (kind !== "text") pen.arc(x(shape), y(shape), Math.max(radius, 1), 0, 2 * Math.PI);
      if (kind === "ring") pen.stroke();
      else if (kind === "square") { pen.globalAlpha = 0.55; pen.fill(); pen.globalAlpha = 1; }
      else pen.fill();
      if (!label) continue;
      const inside = kind === "circle" && pen.measureText(label).width < 2 * radius;
      pen.fillStyle = inside ? "#ffffff" : ink;
      pen.fillText(label, x(shape), inside || kind === "text" ? y(shape) : y(shape) - radius - 9);
    }
    if (!arrays.said) return;
    for (let shape = 0; shape < count; shape++) {
      const word = scene.words[Math.round(arrays.said[first + shape])];
      if (word === undefined) continue;
      const size = unit * scene.shapes[shape][1];
      pen.font = "11px sans-serif"; // smaller where it would hide what a neighbour says
      const room = Math.max(7, 11 * Math.min(1, 2.5 * size / pen.measureText(word).width));
      pen.font = `${room}px sans-serif`;
      const wide = pen.measureText(word).width + 4;
      const middle = Math.min(Math.max(x(shape), wide / 2), width - wide / 2);
      const above = Math.max(y(shape) - size - 12, 9);
      pen.fillStyle = ink;
      pen.fillRect(middle - wide / 2, above - 8, wide, 16);
      pen.fillStyle = paper;
      pen.fillText(word, middle, above);
    }
  }

  function plot() {
    if (!scene || chart.hidden) return;
    const { pen, width, height } = fit(chart);
    const lines = scene.lines.reduce((sum, [, number]) => sum + number, 0), series = arrays.series;
    let low = Infinity, high = -Infinity;
    for (const value of series) { low = Math.min(low, value); high = Math.max(high, value); }
    if (!(high > low)) high = low + 1;
    const x = at => 34 + (width - 40) * at / Math.max(1, scene.frames - 1);
    const y = value => height - 8 - (height - 24) * (value - low) / (high - low);
    pen.font = "10px sans-serif";
    pen.fillStyle = style("--muted");
    pen.textAlign = "right";
    pen.fillText(high.toPrecision(3), 32, y(high) + 4);
    pen.fillText(low.toPrecision(3), 32, y(low));
    pen.textAlign = "left";
    pen.fillText(scene.lines.map(([name]) => name).join(", "), 36, 9);
    pen.lineWidth = 1.2;
    for (let line = 0; line < lines; line++) {
      pen.strokeStyle = colour(line);
      pen.beginPath();
      for (let at = 0; at < scene.frames; at++) pen.lineTo(x(at), y(series[at * lines + line]));
      pen.stroke();
    }
    pen.strokeStyle = style("--ink");
    pen.beginPath();
    pen.moveTo(x(frame), 12);
    pen.lineTo(x(frame), height - 4);
    pen.stroke();
  }

  function go(to) {
    const end = scene ? scene.frames - 1 : 0;
    frame = Math.max(0, Math.min(end, to));
    slider.value = frame;
    slider.setAttribute("aria-valuetext", scene ? scene.captions[frame] : "");
    root.dataset.frame = frame;
    const seconds = scene ? (frame * scene.seconds).toFixed(1) : "0.0";
    caption.textContent = scene ? `${scene.captions[frame]} (${seconds} s)` : "";
    draw();
    plot();
  }

  function start() {
    if (!scene) return;
    if (frame === scene.frames - 1) go(0);
    playing = true;
    last = performance.now();
    owed = 0;
    play.textContent = "Pause";
    requestAnimationFrame(tick);
  }

  function stop() {
    playing = false;
    play.textContent = "Play";
  }

  function tick(now) {
    if (!playing) return;
    owed += (now - last) / 1000 * SPEEDS[speed.selectedIndex] / scene.seconds;
    last = now;
    const steps = Math.floor(owed);
    owed -= steps;
    if (steps > 0) {
      const to = frame + steps, end = scene.frames - 1;
      if (to > end && loop.checked) go(to % (end + 1));
      else go(to);
      if (frame === end && !loop.checked) return stop();
    }
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
  play.addEventListener("click", toggle);
  part("back").addEventListener("click", () => step(-1));
  part("on").addEventListener("click", () => step(1));
  slider.addEventListener("input", () => { stop(); go(Number(slider.value)); });
  choice.addEventListener("change", () => show(choice.selectedIndex));
  root.addEventListener("keydown", event => {
    const control = event.target.closest("button, select, input[type=checkbox]");
    if (control && event.key === " " || event.target === choice || event.target === speed) return;
    if (event.ctrlKey || event.metaKey || event.altKey || !(event.key in keys)) return;
    event.preventDefault();
    keys[event.key]();
  });
  new ResizeObserver(() => go(frame)).observe(canvas);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => go(frame));
  scenes.forEach(each => choice.add(new Option(each.name)));
  SPEEDS.forEach(each => speed.add(new Option(`${each} ×`)));
  speed.selectedIndex = SPEEDS.indexOf(1);
  root.hidden = false;
  show(0);
})();
