// Plots what scenes recorded against frames, each line in a look of its own, and marks the moment
// that is shown. Its colours are none of those that a scene's tints have.
function chartOf(canvas, key, theme) {
  const COLOURS = ["#7b57c4", "#c2405a", "#6f8000", "#2b8ca3", "#96603a", "#64748b"];
  const DASHES = [["solid", []], ["dashed", [6, 3]], ["dotted", [2, 2]]];
  const MOST = 12; // lines of one series that are told apart
  const LEFT = 44, MARGIN = 10, TOP = 8, BOTTOM = 26, EVERY = 70; // px; between marks on the axis
  const UNLIKE = 20; // a series so many times flatter than another has a scale of its own
  let lines = [], frames = 0, sheet = null, scales = { left: [0, 1], right: null };

  const look = line => ({
    colour: COLOURS[line % COLOURS.length],
    dash: DASHES[Math.floor(line / COLOURS.length) % DASHES.length],
  });

  // The lines of a scene, from its series' names and numbers of lines.
  function linesOf({ scene, arrays }) {
    const count = scene.lines.reduce((sum, [, number]) => sum + number, 0);
    let place = 0, looks = 0;
    return scene.lines.flatMap(([name, number]) => {
      const many = number > MOST, first = looks;
      looks += many ? 1 : number;
      return Array.from({ length: number }, (_, line) => {
        const at = place++;
        return {
          ...look(many ? first : first + line), frames: scene.frames, series: name,
          name: many ? `${name}, ${number} lines` : number > 1 ? `${name} ${line + 1}` : name,
          value: frame => arrays.series[frame * count + at],
        };
      });
    });
  }

  // All lines of one scene, or the first of each of several.
  function show(cast, length, laneColour) {
    frames = length;
    lines = cast.length === 1 ? linesOf(cast[0]) : cast.flatMap((each, lane) =>
      linesOf(each).slice(0, 1).map(line => ({
        ...line, colour: laneColour(lane), dash: DASHES[0], name: `${each.mark}: ${line.name}`,
      })));
    canvas.hidden = key.hidden = lines.length === 0 || frames < 2;
    scales = scalesOf();
    const named = new Map(lines.map(line => [line.right ? `${line.name} (right)` : line.name, line]));
    key.replaceChildren(...[...named].map(([name, line]) => {
      const item = document.createElement("li"), swatch = document.createElement("span");
      swatch.className = "stroke";
      swatch.style.borderTop = `2px ${line.dash[0]} ${line.colour}`;
      const words = document.createElement("span");
      words.textContent = name;
      words.dir = "auto";
      item.append(swatch, words);
      return item;
    }));
    sheet = null;
  }

  const end = width => width - (scales.right ? LEFT : MARGIN);
  const across = width => at => LEFT + (end(width) - LEFT) * at / Math.max(1, frames - 1);

  // The curves are drawn once, and then only the mark moves.
  function draw(frame) {
    if (canvas.hidden) return;
    const { pen, width, height } = fitted(canvas);
    const sort = [width, height, canvas.width, theme().ink].join();
    if (!sheet || sheet.sort !== sort) {
      sheet = { sort, paper: document.createElement("canvas") };
      sheet.paper.width = canvas.width;
      sheet.paper.height = canvas.height;
      const copy = sheet.paper.getContext("2d");
      copy.setTransform(pen.getTransform());
      drawCurves(copy, width, height);
    }
    if (!sheet.paper.width || !sheet.paper.height) return;
    pen.drawImage(sheet.paper, 0, 0, width, height);
    const x = across(width)(frame);
    pen.strokeStyle = theme().ink;
    pen.lineWidth = 1.2;
    pen.beginPath();
    pen.moveTo(x, TOP - 4);
    pen.lineTo(x, height - BOTTOM + 4);
    pen.stroke();
  }

  // The least and the greatest value of some lines.
  function extent(some) {
    let low = Infinity, high = -Infinity;
    for (const line of some)
      for (let at = 0; at < line.frames; at++) {
        const value = line.value(at);
        if (Number.isNaN(value)) continue;
        low = Math.min(low, value);
        high = Math.max(high, value);
      }
    return [low, high];
  }

  // What an axis reaches from and to.
  function range(some) {
    const [low, high] = extent(some);
    return high > low ? [low, high] : Number.isFinite(low) ? [low, low + 1] : [0, 1];
  }

  // Lines on the left, and on the right those of series that would be flat there.
  function scalesOf() {
    const spans = new Map();
    for (const { series } of lines) {
      if (spans.has(series)) continue;
      const [low, high] = extent(lines.filter(line => line.series === series));
      spans.set(series, high > low ? high - low : 0);
    }
    const most = Math.max(...spans.values());
    for (const line of lines) {
      const span = spans.get(line.series);
      line.right = 0 < span && span * UNLIKE < most;
    }
    const right = lines.filter(line => line.right);
    return {
      left: range(lines.filter(line => !line.right)),
      right: right.length ? range(right) : null,
    };
  }

  // In few digits: what is next to nothing beside the range is nothing.
  function bound(value, span) {
    return Math.abs(value) < span / 1000 ? 0 : +value.toPrecision(3);
  }

  function drawCurves(pen, width, height) {
    const bottom = height - BOTTOM, x = across(width);
    const y = (value, [low, high]) => bottom - (bottom - TOP) * (value - low) / (high - low);
    pen.font = "10px sans-serif";
    pen.fillStyle = theme().muted;
    drawBounds(pen, scales.left, "right", LEFT - 4, bottom);
    if (scales.right) drawBounds(pen, scales.right, "left", end(width) + 4, bottom);
    drawAxis(pen, x, bottom, width);
    pen.lineWidth = 1.4;
    for (const line of lines) {
      pen.strokeStyle = line.colour;
      pen.setLineDash(line.dash[1]);
      pen.beginPath();
      for (let at = 0; at < line.frames; at++) {
        pen.lineTo(x(at), y(line.value(at), line.right ? scales.right : scales.left));
      }
      pen.stroke();
    }
    pen.setLineDash([]);
  }

  function drawBounds(pen, [low, high], align, at, bottom) {
    pen.textAlign = align;
    pen.fillText(bound(high, high - low), at, TOP + 4);
    pen.fillText(bound(low, high - low), at, bottom + 3);
  }

  // Frames, at round numbers.
  function drawAxis(pen, x, bottom, width) {
    pen.strokeStyle = theme().muted;
    pen.lineWidth = 1;
    pen.beginPath();
    pen.moveTo(x(0), bottom + 0.5);
    pen.lineTo(end(width), bottom + 0.5);
    const least = Math.max(1, (frames - 1) * EVERY / (end(width) - LEFT));
    const ten = 10 ** Math.floor(Math.log10(least));
    const step = ten * [1, 2, 5, 10].find(each => ten * each >= least);
    pen.textAlign = "center";
    for (let mark = 0; mark < frames; mark += step) {
      pen.moveTo(x(mark), bottom);
      pen.lineTo(x(mark), bottom + 4);
      pen.fillText(mark ? mark : "frame 0", x(mark), bottom + 14);
    }
    pen.stroke();
  }

  return { show, draw };
}
