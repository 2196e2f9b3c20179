// Draws scenes in space with three.js: voxels that turn, grow and shrink, on a floor with a scale.
// Positions are in metres, z upwards. Several scenes stand side by side, in lanes along x.
function spaceStage(canvas, theme, laneColour) {
  const VIEW = [-0.3, -1, 0.5], FIELD = 35; // from where, and how wide, in degrees
  const LIGHT = [-0.5, -0.8, 2.0];
  const AXES = [0, 1, 2];
  const MOST = 1000; // lines on the floor, in each direction
  const DAMP = 0.0002; // m: how high above the floor shadows lie
  let robots = [], middles = [], size = 0.1, spacing = 0, fit = 1, following = true;

  const renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true });
  const camera = new THREE.PerspectiveCamera(FIELD, 1, 0.001, 100);
  camera.up.set(0, 0, 1);
  const controls = new THREE.OrbitControls(camera, canvas);
  controls.enablePan = controls.enableZoom = false; // the wheel scrolls the page, until focused
  controls.maxPolarAngle = 0.49 * Math.PI;
  canvas.style.touchAction = "pan-y"; // as does an upward swipe
  const stage = new THREE.Scene(), floor = new THREE.Group(), cast = new THREE.Group();
  const sun = new THREE.DirectionalLight("#ffffff", 2.4);
  sun.position.set(...LIGHT);
  stage.add(new THREE.HemisphereLight("#ffffff", "#a0a0a0", 2.6), sun, floor, cast);
  const box = new THREE.BoxGeometry(1, 1, 1), edges = edged();
  const flat = new THREE.Matrix4().set(
    1, 0, -LIGHT[0] / LIGHT[2], 0, 0, 1, -LIGHT[1] / LIGHT[2], 0, 0, 0, 0, DAMP, 0, 0, 0, 1);
  const place = new THREE.Vector3(), turn = new THREE.Quaternion(), stretch = new THREE.Vector3();
  const next = new THREE.Quaternion(), matrix = new THREE.Matrix4(), shade = new THREE.Matrix4();
  const tone = new THREE.Color();

  // A face with a dark rim, so that voxels can be told apart.
  function edged() {
    const face = document.createElement("canvas"), wide = 64;
    face.width = face.height = wide;
    const pen = face.getContext("2d");
    pen.fillStyle = "#ffffff";
    pen.fillRect(0, 0, wide, wide);
    pen.strokeStyle = "#6a6a6a";
    pen.lineWidth = 5;
    pen.strokeRect(0, 0, wide, wide);
    return new THREE.CanvasTexture(face);
  }

  function robotOf({ scene, arrays }, lane) {
    const count = scene.shapes.length;
    const voxels = new THREE.InstancedMesh(box, new THREE.MeshLambertMaterial({ map: edges }), count);
    const shadow = new THREE.InstancedMesh(
      box, new THREE.MeshBasicMaterial({ side: THREE.DoubleSide }), count);
    voxels.frustumCulled = shadow.frustumCulled = false;
    cast.add(voxels, shadow);
    const low = [Infinity, Infinity, Infinity], high = low.map(bound => -bound);
    arrays.position.forEach((value, index) => {
      if (Number.isNaN(value)) return;
      const axis = index % 3;
      low[axis] = Math.min(low[axis], value);
      high[axis] = Math.max(high[axis], value);
    });
    const edge = 2 * Math.max(...scene.shapes.map(([, half]) => half));
    const long = extent(arrays.position.subarray(0, 3 * count)) + edge;
    const tones = scene.palette.map(([, colour]) => new THREE.Color(colour));
    return { scene, arrays, count, lane, voxels, shadow, low, high, edge, long, tones, label: null };
  }

  function extent(points) { // along x
    let low = Infinity, high = -Infinity;
    for (let at = 0; at < points.length; at += 3) {
      if (Number.isNaN(points[at])) continue;
      low = Math.min(low, points[at]);
      high = Math.max(high, points[at]);
    }
    return high - low;
  }

  function empty(group) {
    for (const each of [...group.children]) {
      group.remove(each);
      each.dispose?.();
      if (each.geometry && each.geometry !== box) each.geometry.dispose();
      if (each.isSprite) each.material.map.dispose();
      each.material.dispose();
    }
  }

  // Lines every step, stronger ones every tenth, and there how far it is from the start.
  function layFloor() {
    empty(floor);
    const step = 10 ** Math.floor(Math.log10(0.7 * size)), margin = 4 * step;
    const low = Math.min(...robots.map(each => each.low[0])) - margin;
    const high = Math.max(...robots.map(each => each.high[0])) + 3 * margin;
    const near = -spacing * (robots.length - 0.4), far = 0.8 * spacing;
    const kept = edge => Math.max(-MOST * step, Math.min(MOST * step, edge)); // a shape may be far
    const x0 = step * Math.floor(kept(low) / step), x1 = step * Math.ceil(kept(high) / step);
    const y0 = step * Math.floor(kept(near) / step), y1 = step * Math.ceil(kept(far) / step);
    const thin = [], thick = [];
    for (let k = Math.round(x0 / step); k <= Math.round(x1 / step); k++) {
      (k % 10 ? thin : thick).push(k * step, y0, 0, k * step, y1, 0);
      if (k % 5 === 0) floor.add(label(`${+(1000 * k * step).toPrecision(4)} mm`, theme().muted, 0.7,
        new THREE.Vector3(k * step, y0 - 0.4 * step, 0)));
    }
    for (let k = Math.round(y0 / step); k <= Math.round(y1 / step); k++)
      (k % 10 ? thin : thick).push(x0, k * step, 0, x1, k * step, 0);
    for (const [points, opacity] of [[thin, 0.25], [thick, 0.7]]) {
      const lines = new THREE.BufferGeometry();
      lines.setAttribute("position", new THREE.Float32BufferAttribute(points, 3));
      floor.add(new THREE.LineSegments(lines, new THREE.LineBasicMaterial(
        { color: theme().muted, transparent: true, opacity })));
    }
  }

  // Text that always faces the viewer, as large however far away.
  function label(text, colour, scale, position) {
    const paper = document.createElement("canvas"), height = 48;
    let pen = paper.getContext("2d");
    const font = "600 30px sans-serif";
    pen.font = font;
    paper.width = Math.ceil(pen.measureText(text).width) + 16;
    paper.height = height;
    pen = paper.getContext("2d");
    pen.font = font;
    pen.fillStyle = colour;
    pen.textBaseline = "middle";
    pen.fillText(text, 8, height / 2);
    const map = new THREE.CanvasTexture(paper);
    map.colorSpace = "srgb";
    const sprite = new THREE.Sprite(new THREE.SpriteMaterial(
      { map, sizeAttenuation: false, depthTest: false }));
    sprite.scale.set(0.045 * scale * paper.width / height, 0.045 * scale, 1);
    sprite.position.copy(position);
    return sprite;
  }

  function pose(robot, frame, share) {
    const { scene, arrays, count, voxels, shadow, lane, tones } = robot;
    const now = Math.min(frame, scene.frames - 1), on = now + 1 < scene.frames ? share : 0;
    const first = now * count, then = on > 0 ? first + count : first;
    const between = (array, width, shape, axis) => {
      const here = array[width * (first + shape) + axis];
      return here + on * (array[width * (then + shape) + axis] - here);
    };
    const middle = [0, 0, 0];
    let shown = 0;
    for (let shape = 0; shape < count; shape++) {
      place.set(...AXES.map(axis => between(arrays.position, 3, shape, axis)));
      const hidden = arrays.tint[first + shape] < 0;
      if (hidden) place.set(0, 0, 0);
      else {
        for (const axis of AXES) middle[axis] += place.getComponent(axis);
        shown += 1;
      }
      place.y -= lane * spacing;
      turn.set(0, 0, 0, 1);
      if (arrays.orientation) {
        turned(arrays.orientation, first + shape, turn);
        if (on > 0) turn.slerp(turned(arrays.orientation, then + shape, next), on);
      }
      const grown = arrays.scale ? between(arrays.scale, 1, shape, 0) : 1;
      stretch.setScalar(hidden ? 0 : 2 * scene.shapes[shape][1] * grown);
      matrix.compose(place, turn, stretch);
      voxels.setMatrixAt(shape, matrix);
      shadow.setMatrixAt(shape, shade.multiplyMatrices(flat, matrix));
      voxels.setColorAt(shape, hidden ? tone : scene.graded
        ? graded(tones, (grown - 1) / scene.graded) : tones[arrays.tint[first + shape]]);
    }
    voxels.instanceMatrix.needsUpdate = shadow.instanceMatrix.needsUpdate = true;
    voxels.instanceColor.needsUpdate = true;
    for (const axis of AXES) middle[axis] /= Math.max(1, shown);
    robot.label?.position.set(middle[0], middle[1] - lane * spacing, middle[2] + 2.2 * robot.edge);
    return middle;
  }

  // Between contracted, at rest and expanded; beyond a change of 1 no further.
  function graded([low, rest, high], change) {
    return tone.copy(rest).lerp(change < 0 ? low : high, Math.min(1, Math.abs(change)));
  }

  function turned(array, entry, quaternion) { // stored as w, x, y, z
    const at = 4 * entry;
    return quaternion.set(array[at + 1], array[at + 2], array[at + 3], array[at]).normalize();
  }

  // The camera keeps its direction and moves with the robots, farther away as they part.
  function follow(middles) {
    if (!(camera.aspect > 0)) camera.aspect = 1; // before it was ever in sight
    const across = middles.map(([x]) => x);
    const first = Math.min(...across), last = Math.max(...across);
    const wide = last - first + 2.6 * size;
    const deep = spacing * (robots.length - 1) + size;
    const wanted = Math.max(wide / Math.min(camera.aspect, 2), 0.9 * deep, 1.6 * size);
    const offset = camera.position.clone().sub(controls.target).multiplyScalar(wanted / fit);
    fit = wanted;
    const height = Math.max(...robots.map(each => (each.low[2] + each.high[2]) / 2));
    controls.target.set((first + last) / 2, -deep / 2 + size / 2, height);
    camera.position.copy(controls.target).add(offset);
  }

  function reset() {
    fit = 1; // until it follows, once at least
    const distance = 0.5 / Math.tan(FIELD * Math.PI / 360);
    camera.position.set(...VIEW).normalize().multiplyScalar(1.15 * distance).add(controls.target);
  }

  function orbit(around, up, nearer) {
    const offset = camera.position.clone().sub(controls.target), far = offset.length();
    const flatly = Math.hypot(offset.x, offset.y);
    const angle = Math.atan2(offset.y, offset.x) + around;
    const height = Math.min(1.5, Math.max(0.05, Math.atan2(offset.z, flatly) + up));
    offset.set(Math.cos(height) * Math.cos(angle), Math.cos(height) * Math.sin(angle),
      Math.sin(height));
    camera.position.copy(controls.target).add(offset.multiplyScalar(far * nearer));
  }

  return {
    keys: {
      a: () => orbit(-0.15, 0, 1), d: () => orbit(0.15, 0, 1),
      w: () => orbit(0, 0.1, 1), s: () => orbit(0, -0.1, 1),
      "+": () => orbit(0, 0, 0.85), "-": () => orbit(0, 0, 1 / 0.85),
      0: () => { reset(); follow(middles); },
    },
    whenTurned: redraw => controls.addEventListener("change", redraw),
    zoom: allowed => { controls.enableZoom = allowed; },
    follow: wanted => { following = wanted; },
    show(shown) {
      canvas.style.aspectRatio = 16 / 9;
      empty(cast);
      robots = shown.map(robotOf);
      size = Math.max(...robots.map(each => each.long));
      spacing = 2.4 * Math.max(...robots.map(each => each.high[1] - each.low[1] + 2 * each.edge));
      if (robots.length > 1) robots.forEach((each, lane) => {
        each.label = label(shown[lane].mark, laneColour(lane), 1.2, place);
        cast.add(each.label);
      });
      layFloor();
      reset();
      middles = robots.map(each => pose(each, 0, 0));
      follow(middles);
    },
    restyle: layFloor,
    draw(frame, share) {
      const width = canvas.clientWidth, height = canvas.clientHeight;
      if (!width || !height) return; // not in sight
      renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
      renderer.setSize(width, height, false);
      camera.aspect = width / height;
      middles = robots.map(each => pose(each, frame, share));
      if (following) follow(middles);
      camera.near = camera.position.distanceTo(controls.target) / 50;
      camera.far = 200 * camera.near;
      camera.updateProjectionMatrix();
      robots.forEach(each => each.shadow.material.color.set(theme().rule));
      camera.lookAt(controls.target);
      renderer.render(stage, camera);
    },
  };
}
