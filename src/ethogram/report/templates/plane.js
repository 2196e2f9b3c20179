// Draws a scene in the plane on a canvas. A stage shows a cast, and draws it at a moment: a frame,
// and how far on the way to the next one.
function planeStage(canvas, colour, theme) {
  let scene = null, arrays = {};

  // Fits the bounds into the canvas, the same scale on both axes, y upwards.
  function fit() {
    const { pen, width, height } = fitted(canvas);
    const [left, bottom, right, top] = scene.bounds;
    const unit = Math.min(
      width / Math.max(right - left, 1e-9), height / Math.max(top - bottom, 1e-9));
    const x0 = (width - unit * (right - left)) / 2, y0 = (height - unit * (top - bottom)) / 2;
    const place = (x, y) => [x0 + unit * (x - left), y0 + unit * (top - y)];
    return { pen, width, unit, place };
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

  function drawShape(pen, unit, [x, y], shape, first) {
    const tint = Math.round(arrays.tint[first + shape]);
    if (tint < 0) return;
    const [kind, size, label] = scene.shapes[shape];
    const radius = unit * size * (arrays.scale ? arrays.scale[first + shape] : 1);
    pen.fillStyle = pen.strokeStyle = colour(tint);
    pen.beginPath();
    if (kind === "square") pen.rect(x - radius, y - radius, 2 * radius, 2 * radius);
    else if (kind !== "text") pen.arc(x, y, Math.max(radius, 1), 0, 2 * Math.PI);
    if (kind === "ring") pen.stroke();
    else if (kind === "square") { pen.globalAlpha = 0.55; pen.fill(); pen.globalAlpha = 1; }
    else pen.fill();
    if (!label) return;
    const inside = kind === "circle" && pen.measureText(label).width < 2 * radius;
    pen.fillStyle = inside ? "#ffffff" : theme().ink;
    pen.fillText(label, x, inside || kind === "text" ? y : y - radius - 9);
  }

  function drawWord(pen, unit, width, [x, y], shape, first) {
    const word = scene.words[Math.round(arrays.said[first + shape])];
    if (word === undefined) return;
    const size = unit * scene.shapes[shape][1];
    pen.font = "11px sans-serif"; // smaller where it would hide what a neighbour says
    const room = Math.max(7, 11 * Math.min(1, 2.5 * size / pen.measureText(word).width));
    pen.font = `${room}px sans-serif`;
    const wide = pen.measureText(word).width + 4;
    const middle = Math.min(Math.max(x, wide / 2), width - wide / 2);
    const above = Math.max(y - size - 12, 9);
    pen.fillStyle = theme().ink;
    pen.fillRect(middle - wide / 2, above - 8, wide, 16);
    pen.fillStyle = theme().paper;
    pen.fillText(word, middle, above);
  }

  return {
    show(cast) {
      [{ scene, arrays }] = cast;
      const [left, bottom, right, top] = scene.bounds;
      canvas.style.aspectRatio =
        Math.min(4, Math.max(1, (right - left) / Math.max(top - bottom, 1e-9)));
    },
    draw(frame, share) {
      const { pen, width, unit, place } = fit();
      const first = frame * scene.shapes.length;
      const where = places(frame, frame + 1 < scene.frames ? share : 0, place);
      pen.font = `${Math.max(10, Math.min(13, width / 50))}px sans-serif`;
      pen.textAlign = "center";
      pen.textBaseline = "middle";
      drawLinks(pen, where, first);
      where.forEach((at, shape) => drawShape(pen, unit, at, shape, first));
      if (arrays.said) where.forEach((at, shape) => drawWord(pen, unit, width, at, shape, first));
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
