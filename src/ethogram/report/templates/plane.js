// Draws a scene in the plane on a canvas. A stage shows a cast, and draws it at a moment: a frame,
// and how far on the way to the next one.
function planeStage(canvas, colour, theme) {
  const HIGH = 16, LEVELS = 6; // px, of what is said; rows above each other
  let scene = null, arrays = {};

  // Fits the bounds into the canvas, the same scale on both axes, y upwards.
  function fit() {
    const { pen, width, height } = fitted(canvas);
    const [left, bottom, right, top] = scene.bounds;
    const unit = Math.min(
      width / Math.max(right - left, 1e-9), height / Math.max(top - bottom, 1e-9));
    const x0 = (width - unit * (right - left)) / 2, y0 = (height - unit * (top - bottom)) / 2;
    const place = (x, y) => [x0 + unit * (x - left), y0 + unit * (top - y)];
    return { pen, width, height, unit, place };
  }

  // Where each shape is; one that is somewhere anew in the next frame stays until then.
  function places(frame, share, place) {
    const count = scene.shapes.length, first = frame * count, next = first + count;
    return scene.shapes.map((_, shape) => {
      const gone = share > 0 && !(arrays.fresh && arrays.fresh[next + shape]);
      const at = axis => {
        const here = arrays.position[2 * (first + shape) + axis];
        return gone ? here + share * (arrays.position[2 * (next + shape) + axis] - here) : here;
      };
      return place(at(0), at(1));
    });
  }

  function drawLinks(pen, where, first) {
    pen.lineWidth = 1;
    pen.strokeStyle = theme().muted;
    for (const [one, other] of scene.links) {
      if (arrays.tint[first + one] < 0 || arrays.tint[first + other] < 0) continue;
      pen.beginPath();
      pen.moveTo(...where[one]);
      pen.lineTo(...where[other]);
      pen.stroke();
    }
  }

  // A circle has a rim, so that it is seen on a square and beside another of the same tint.
  function drawShape(pen, unit, [x, y], shape, first) {
    const tint = Math.round(arrays.tint[first + shape]);
    if (tint < 0) return;
    const [kind, , label] = scene.shapes[shape], radius = radiusOf(unit, shape, first);
    pen.fillStyle = pen.strokeStyle = colour(tint);
    pen.beginPath();
    if (kind === "square") pen.rect(x - radius, y - radius, 2 * radius, 2 * radius);
    else if (kind !== "text") pen.arc(x, y, Math.max(radius, 1), 0, 2 * Math.PI);
    if (kind === "ring") pen.stroke();
    else {
      pen.fill();
      pen.strokeStyle = theme().wash;
      if (kind === "circle" && radius > 3) pen.stroke();
    }
    if (!label) return;
    const inside = kind === "circle" && pen.measureText(label).width < 2 * radius;
    pen.fillStyle = inside ? "#ffffff" : theme().ink;
    // a square's is below it: above stand words, and what is on the square
    const away = inside || kind === "text" ? 0 : kind === "square" ? radius + 9 : -radius - 9;
    pen.fillText(label, x, y + away);
  }

  const radiusOf = (unit, shape, first) =>
    unit * scene.shapes[shape][1] * (arrays.scale ? arrays.scale[first + shape] : 1);

  // What is said stands beside who says it, where it hides neither who else is there nor what they
  // say: above, to the right, to the left, below, or further up with a line.
  function drawWords(pen, { width, height, unit }, where, first) {
    const font = "11px sans-serif", taken = [], said = [];
    pen.font = font;
    where.forEach(([x, y], shape) => {
      if (arrays.tint[first + shape] < 0 || !Number.isFinite(x + y)) return;
      const word = scene.words[Math.round(arrays.said[first + shape])];
      const radius = radiusOf(unit, shape, first);
      if (["circle", "ring"].includes(scene.shapes[shape][0]))
        taken.push([x - radius, y - radius, x + radius, y + radius, shape]);
      if (word !== undefined) said.push({ word, x, y, radius, shape });
    });
    said.sort((one, other) => one.y - other.y || one.x - other.x);
    for (const each of said) {
      const wide = Math.min(pen.measureText(each.word).width + 8, width);
      const found = placeFor(each, wide, width, height, taken);
      if (found) taken.push(found);
      drawWord(pen, each, found);
    }
  }

  function placeFor({ x, y, radius, shape }, wide, width, height, taken) {
    const clear = radius + 3, half = HIGH / 2;
    const itself = [x - radius, y - radius, x + radius, y + radius];
    for (let turn = 0; turn < LEVELS + 4; turn++) {
      const beside = turn === 1 || turn === 2, level = Math.max(0, turn - 3);
      const start = turn === 1 ? x + clear : turn === 2 ? x - clear - wide : x - wide / 2;
      const middle = beside ? y : turn === 3 ? y + clear + half
        : y - clear - half - level * (HIGH + 2);
      const left = Math.min(Math.max(start, 0), width - wide);
      const box = [left, middle - half, left + wide, middle + half];
      if (box[1] < 0 || box[3] > height || meet(box, itself)) continue;
      if (!taken.some(other => other[4] !== shape && meet(box, other))) return box;
    }
    return undefined;
  }

  const meet = (one, other) =>
    one[0] < other[2] + 1 && other[0] < one[2] + 1 && one[1] < other[3] + 1 && other[1] < one[3] + 1;

  // Where there is room for no word, a dot tells that there is one.
  function drawWord(pen, { word, x, y, radius }, box) {
    pen.strokeStyle = pen.fillStyle = theme().ink;
    pen.lineWidth = 1;
    if (!box) {
      pen.beginPath();
      pen.arc(x, y - radius, 3, 0, 2 * Math.PI);
      pen.fill();
      return;
    }
    const [left, top, right, bottom] = box.map(Math.round);
    if (bottom < y - radius - HIGH) {
      pen.beginPath();
      pen.moveTo(x, y - radius);
      pen.lineTo(Math.min(Math.max(x, left), right), bottom);
      pen.stroke();
    }
    pen.fillStyle = theme().paper;
    pen.beginPath();
    pen.roundRect(left + 0.5, top + 0.5, right - left - 1, bottom - top - 1, 4);
    pen.fill();
    pen.stroke();
    pen.fillStyle = theme().ink;
    pen.fillText(word, (left + right) / 2, (top + bottom) / 2, right - left - 4);
  }

  return {
    show(cast) {
      [{ scene, arrays }] = cast;
      const [left, bottom, right, top] = scene.bounds;
      canvas.style.aspectRatio =
        Math.min(4, Math.max(1, (right - left) / Math.max(top - bottom, 1e-9)));
    },
    draw(frame, share) {
      const field = fit(), { pen, width, unit, place } = field;
      const first = frame * scene.shapes.length;
      const where = places(frame, frame + 1 < scene.frames ? share : 0, place);
      pen.font = `${Math.max(10, Math.min(13, width / 50))}px sans-serif`;
      pen.textAlign = "center";
      pen.textBaseline = "middle";
      drawLinks(pen, where, first);
      where.forEach((at, shape) => drawShape(pen, unit, at, shape, first));
      if (arrays.said) drawWords(pen, field, where, first);
    },
  };
}

// A cleared canvas, as large as it is shown, in its own pixels.
function fitted(canvas) {
  const density = window.devicePixelRatio || 1;
  const width = canvas.clientWidth, height = canvas.clientHeight;
  if (canvas.width !== Math.round(width * density)) canvas.width = Math.round(width * density);
  if (canvas.height !== Math.round(height * density)) canvas.height = Math.round(height * density);
  const pen = canvas.getContext("2d");
  pen.setTransform(density, 0, 0, density, 0, 0);
  pen.clearRect(0, 0, width, height);
  return { pen, width, height };
}
