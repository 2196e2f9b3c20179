// Draws a scene in the plane on a canvas. A stage shows a cast, and draws it at a moment: a frame,
// and how far on the way to the next one.
function planeStage(canvas, theme) {
  const HIGH = 16, LEVELS = 6; // px, of what is said; rows above each other
  const CLEAR = 9, MARK = 0.5, LEAST_MARK = 4; // of labels and of headings, as render/*.py
  const WORD = "11px sans-serif";
  const SILENT = ["square", "text"]; // kinds that hide no words
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

  // Numbers at a moment; of a shape that is somewhere anew in the next frame, until then as before.
  function momentOf(frame, share) {
    const count = scene.shapes.length, first = frame * count, next = first + count;
    const going = shape => share > 0 && !(arrays.fresh && arrays.fresh[next + shape]);
    const between = (array, wide, shape, at) => {
      const here = array[wide * (first + shape) + at];
      return going(shape) ? here + share * (array[wide * (next + shape) + at] - here) : here;
    };
    const heading = shape => {
      const here = arrays.heading[first + shape];
      if (!going(shape)) return here;
      const turn = arrays.heading[next + shape] - here;
      return here + share * (turn - 2 * Math.PI * Math.round(turn / (2 * Math.PI)));
    };
    return { first, between, heading };
  }

  // What is drawn of a shape: where it is, how large, and a polygon's corners, all in pixels.
  function shapeAt(shape, moment, { unit, place }) {
    const [kind, size, label, own] = scene.shapes[shape], { first, between } = moment;
    const tint = Math.round(arrays.tint[first + shape]);
    if (tint < 0) return null;
    const x = between(arrays.position, 2, shape, 0), y = between(arrays.position, 2, shape, 1);
    const grown = size * (arrays.scale ? arrays.scale[first + shape] : 1);
    const angle = arrays.heading && kind !== "text" ? moment.heading(shape) : NaN;
    const [, colour, letters] = scene.palette[tint], [px, py] = place(x, y);
    const found = { shape, kind, label, colour, letters, angle, x: px, y: py };
    if (kind !== "polygon") return { ...found, radius: unit * grown, inner: unit * grown };
    const vertices = own ?? Array.from({ length: scene.vertices }, (_, vertex) => [0, 1].map(axis =>
      between(arrays.vertices, 2 * scene.vertices, shape, 2 * vertex + axis)));
    const known = vertices.filter(([dx, dy]) => Number.isFinite(dx + dy));
    const cos = arrays.heading ? Math.cos(angle) : 1, sin = arrays.heading ? Math.sin(angle) : 0;
    const corners = known.map(([dx, dy]) =>
      place(x + grown * (cos * dx - sin * dy), y + grown * (sin * dx + cos * dy)));
    const furthest = of => unit * grown * Math.max(0, ...known.map(of));
    return { ...found, corners, radius: furthest(([dx, dy]) => Math.hypot(dx, dy)),
      inner: Math.min(furthest(([dx]) => Math.abs(dx)), furthest(([, dy]) => Math.abs(dy))) };
  }

  function path(pen, points) {
    pen.beginPath();
    for (const point of points) pen.lineTo(...point);
  }

  function drawBackground(pen, { unit, place }) {
    pen.lineCap = pen.lineJoin = "round";
    for (const [kind, points, tint, width] of scene.background) {
      pen.fillStyle = pen.strokeStyle = scene.palette[tint][1];
      pen.lineWidth = Math.max(1, unit * width);
      path(pen, points.map(point => place(...point)));
      if (kind === "polygon") pen.fill();
      else pen.stroke();
    }
    pen.lineCap = "butt";
  }

  function drawLinks(pen, shown) {
    pen.lineWidth = 1;
    pen.strokeStyle = theme().muted;
    for (const [one, other] of scene.links) {
      if (!shown[one] || !shown[other]) continue;
      path(pen, [[shown[one].x, shown[one].y], [shown[other].x, shown[other].y]]);
      pen.stroke();
    }
  }

  // Circles and polygons have a rim, so that they are seen beside others of the same tint.
  function drawShape(pen, { kind, x, y, radius, colour, angle, corners }) {
    pen.lineWidth = 1;
    pen.fillStyle = pen.strokeStyle = colour;
    if (kind === "polygon") {
      path(pen, corners);
      pen.closePath();
    } else {
      pen.beginPath();
      if (kind === "square") pen.rect(x - radius, y - radius, 2 * radius, 2 * radius);
      else if (kind !== "text") pen.arc(x, y, Math.max(radius, 1), 0, 2 * Math.PI);
    }
    if (kind === "ring") pen.stroke();
    else {
      pen.fill();
      pen.strokeStyle = theme().wash;
      if (kind === "polygon" || (kind === "circle" && radius > 3)) pen.stroke();
    }
    if (kind === "polygon" || !Number.isFinite(angle)) return;
    drawHeading(pen, { kind, x, y, radius, colour, angle });
  }

  // A mark that begins at the edge.
  function drawHeading(pen, { kind, x, y, radius, colour, angle }) {
    const across = Math.cos(angle), up = Math.sin(angle);
    const edge = kind === "square" ? radius / Math.max(Math.abs(across), Math.abs(up)) : radius;
    const ends = [edge, edge + Math.max(LEAST_MARK, MARK * radius)];
    pen.strokeStyle = colour;
    pen.lineWidth = 2;
    path(pen, ends.map(end => [x + end * across, y - end * up]));
    pen.stroke();
  }

  // Where a label stands: within a shape where there is room, else above it. A square's is below
  // it: above stand words, and what is on the square.
  function labelOf(pen, { kind, label, x, y, radius, inner }, high) {
    const wide = pen.measureText(label).width;
    const room = kind === "circle" || 2 * inner > high ? 2 * inner : 0;
    const inside = ["circle", "polygon"].includes(kind) && wide < room;
    const away = inside || kind === "text" ? 0 : kind === "square" ? radius + CLEAR : -radius - CLEAR;
    const middle = y + away;
    const box = [x - wide / 2, middle - high / 2, x + wide / 2, middle + high / 2];
    return { inside, x, y: middle, box };
  }

  function drawLabel(pen, { label, letters }, where) {
    pen.fillStyle = where.inside ? letters : theme().ink;
    pen.fillText(label, where.x, where.y);
  }

  // What is said stands beside who says it, where it hides neither who else is there nor what they
  // say: above, to the right, to the left, below, or further up with a line.
  function placeWords(pen, { width, height }, shown, labels, first) {
    const taken = [...labels], said = [];
    for (const each of shown) {
      const { x, y, radius, shape, kind } = each;
      if (!Number.isFinite(x + y + radius)) continue;
      const word = scene.words[Math.round(arrays.said[first + shape])];
      if (!SILENT.includes(kind) || word !== undefined)
        taken.push([x - radius, y - radius, x + radius, y + radius, shape]);
      if (word !== undefined) said.push({ word, x, y, radius, shape });
    }
    said.sort((one, other) => one.y - other.y || one.x - other.x);
    return said.map(each => {
      const wide = Math.min(pen.measureText(each.word).width + 8, width);
      const box = placeFor(each, wide, width, height, taken);
      if (box) taken.push(box);
      return { ...each, box: box?.map(Math.round) };
    });
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

  // From who speaks to words that are not right beside them.
  function drawLeaders(pen, words) {
    pen.strokeStyle = theme().ink;
    pen.lineWidth = 1;
    for (const { x, y, radius, box } of words) {
      if (!box || box[3] >= y - radius - HIGH) continue;
      path(pen, [[x, y - radius], [Math.min(Math.max(x, box[0]), box[2]), box[3]]]);
      pen.stroke();
    }
  }

  // Where there is room for no word, a dot tells that there is one.
  function drawWord(pen, { word, x, y, radius, box }) {
    pen.strokeStyle = pen.fillStyle = theme().ink;
    pen.lineWidth = 1;
    pen.beginPath();
    if (!box) {
      pen.arc(x, y - radius, 3, 0, 2 * Math.PI);
      pen.fill();
      return;
    }
    const [left, top, right, bottom] = box;
    pen.fillStyle = theme().paper;
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
      const field = fit(), { pen, width } = field;
      const moment = momentOf(frame, frame + 1 < scene.frames ? share : 0);
      const high = Math.max(10, Math.min(13, width / 50)), letters = `${high}px sans-serif`;
      const all = scene.shapes.map((_, shape) => shapeAt(shape, moment, field));
      const shown = all.filter(each => each !== null);
      pen.textAlign = "center";
      pen.textBaseline = "middle";
      pen.font = letters;
      const labels = new Map(shown.filter(each => each.label).map(
        each => [each, labelOf(pen, each, high)]));
      const outside = [...labels.values()].filter(each => !each.inside).map(each => each.box);
      pen.font = WORD;
      const words = arrays.said ? placeWords(pen, field, shown, outside, moment.first) : [];
      pen.font = letters;
      drawBackground(pen, field);
      drawLinks(pen, all);
      const first = shown.find(each => !SILENT.includes(each.kind)); // lines to words lie under it
      for (const each of shown) {
        if (each === first) drawLeaders(pen, words);
        drawShape(pen, each);
        if (labels.has(each)) drawLabel(pen, each, labels.get(each));
      }
      if (!first) drawLeaders(pen, words);
      pen.font = WORD;
      for (const each of words) drawWord(pen, each);
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
