// A square of input and output in three dimensions. One camera shows both, always from the same
// side. The points stand in the page, packed by `viewer.rs`.
const {
  BufferAttribute, BufferGeometry, Color, DepthTexture, LineBasicMaterial, LineSegments, Mesh,
  OrbitControls, OrthographicCamera, PerspectiveCamera, PlaneGeometry, Points, Scene,
  ShaderMaterial, Vector2, Vector3, WebGLRenderer, WebGLRenderTarget,
} = THREE;

const element = (id) => document.getElementById(id);
const place = JSON.parse(element("place").textContent);

/// Returns the points in the element `id`: positions relative to the middle of the square, and
/// attributes, each in a plane of its own.
const unpack = async (id, count) => {
  const packed = Uint8Array.from(atob(element(id).textContent), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const bytes = await new Response(stream).arrayBuffer();
  const positions = new Float32Array(3 * count);
  for (let axis = 0; axis < 3; axis++) {
    const steps = new Uint16Array(bytes, 2 * axis * count, count);
    const middle = axis < 2 ? place.side / 2 : place.floor;
    let at = 0;
    for (let i = 0; i < count; i++) {
      at = (at + steps[i]) & 0xffff;
      positions[3 * i + axis] = at * place.step - middle;
    }
  }
  const plane = (k) => new Uint8Array(bytes, (6 + k) * count, count);
  const hasLevels = bytes.byteLength > 12 * count;
  return {
    count, positions, level: hasLevels ? plane(6) : new Uint8Array(count),
    red: plane(0), green: plane(1), blue: plane(2), intensity: plane(3), class: plane(4), distance: plane(5),
  };
};

const ramp = (stops) => (share) => {
  const along = Math.min(Math.max(share, 0), 1) * (stops.length - 1);
  const low = Math.min(Math.floor(along), stops.length - 2);
  return [0, 1, 2].map((k) => stops[low][k] + (along - low) * (stops[low + 1][k] - stops[low][k]));
};
const heights = ramp([[45, 75, 140], [45, 140, 150], [110, 180, 110], [240, 210, 80]]);
const distances = ramp([[30, 70, 180], [120, 170, 220], [225, 225, 215], [240, 160, 90], [200, 60, 20]]);
// Classes of the LAS specification; others are grey.
const CLASSES = {
  2: ["ground", [160, 120, 80]], 3: ["low vegetation", [150, 200, 90]],
  4: ["medium vegetation", [90, 170, 70]], 5: ["high vegetation", [40, 130, 60]],
  6: ["building", [210, 100, 80]], 7: ["low noise", [230, 60, 200]], 9: ["water", [70, 130, 220]],
  10: ["rail", [90, 90, 100]], 11: ["road", [120, 120, 130]], 13: ["wire guard", [230, 190, 70]],
  14: ["wire", [230, 190, 70]], 15: ["tower", [180, 140, 200]], 17: ["bridge", [190, 170, 140]],
  18: ["high noise", [230, 60, 200]],
};
const GREY = [150, 155, 160];
const classOf = (number) => CLASSES[number] ?? [`class ${number}`, GREY];
const swatch = (color) => `<i style="background:rgb(${color.map(Math.round).join(" ")})"></i>`;

/// Rules of colouring: the colour of point `i` of a side, and a legend.
const colorings = {
  color: {
    of: (side, i) => [side.red[i], side.green[i], side.blue[i]],
    legend: () => "colours of the scanner",
  },
  height: {
    of: (side, i) => heights(side.positions[3 * i + 2] / place.height),
    legend: () => `${swatch(heights(0))} lowest to ${swatch(heights(1))} ${place.height.toFixed(2)} higher`,
  },
  intensity: {
    of: (side, i) => Array(3).fill(30 + 0.88 * side.intensity[i]),
    legend: () => "dark: weak returns; bright: strong ones",
  },
  class: {
    of: (side, i) => classOf(side.class[i])[1],
    legend: (sides) => {
      const met = new Set(sides.flatMap((side) => [...new Set(side.class)]));
      const names = [...met].sort((a, b) => a - b).map(classOf);
      return names.map(([name, color]) => `${swatch(color)} ${name}`).join(" &nbsp; ");
    },
  },
  // The difference between the nearest distance and its mean, up to half a spacing.
  distance: {
    of: (side, i) => (side === before ? GREY : distances(side.distance[i] / 128 - place.usual + 0.5)),
    legend: () => {
      const at = (more) => (place.usual + more).toFixed(2);
      return `output: nearest point at ${swatch(distances(0))} ${at(-0.5)} spacings or less, ` +
        `${swatch(distances(0.5))} ${at(0)} (the mean), ${swatch(distances(1))} ${at(0.5)} or more`;
    },
  },
};

const pointMaterial = () => new ShaderMaterial({
  uniforms: { diameter: { value: 1 }, pixels: { value: 1 }, deepest: { value: 255 } },
  vertexShader: `
    attribute vec3 shade; attribute float level; varying vec3 tint; uniform float diameter, pixels, deepest;
    void main() {
      vec4 seen = modelViewMatrix * vec4(position, 1.0);
      // Points of deeper levels are moved out of sight.
      gl_Position = level > deepest ? vec4(2.0, 2.0, 2.0, 1.0) : projectionMatrix * seen;
      gl_PointSize = max(diameter * pixels / -seen.z, 1.6);
      tint = shade;
    }`,
  fragmentShader: `
    varying vec3 tint;
    void main() {
      vec2 at = gl_PointCoord - 0.5;
      if (dot(at, at) > 0.25) discard;
      gl_FragColor = vec4(tint, 1.0);
    }`,
});

// Points in front of others get a dark rim, which shows shapes without light (eye-dome lighting).
const rim = new ShaderMaterial({
  uniforms: {
    colors: { value: null }, depths: { value: null }, pixel: { value: new Vector2() },
    near: { value: 1 }, far: { value: 2 }, paper: { value: new Color() },
  },
  vertexShader: "varying vec2 at; void main() { at = uv; gl_Position = vec4(position.xy * 2.0, 0.0, 1.0); }",
  fragmentShader: `
    varying vec2 at; uniform sampler2D colors, depths; uniform vec2 pixel; uniform float near, far;
    uniform vec3 paper;
    float away(vec2 where) {
      float depth = texture2D(depths, where).x;
      return log2(near * far / (far - depth * (far - near)));
    }
    void main() {
      if (texture2D(depths, at).x >= 1.0) { gl_FragColor = vec4(paper, 1.0); return; }
      float here = away(at), dark = 0.0;
      for (int k = 0; k < 8; k++) {
        float turn = 0.7853981 * float(k);
        dark += max(0.0, here - away(at + 1.4 * pixel * vec2(cos(turn), sin(turn))));
      }
      gl_FragColor = vec4(texture2D(colors, at).rgb * exp(-3.0 * dark), 1.0);
    }`,
  depthTest: false,
});

const canvas = element("view");
const before = await unpack("before", place.before);
const after = await unpack("after", place.after);
const renderer = new WebGLRenderer({ canvas });
renderer.autoClear = false;
const camera = new PerspectiveCamera(50, 1, place.side / 500, place.side * 8);
camera.up.set(0, 0, 1);
rim.uniforms.near.value = camera.near;
rim.uniforms.far.value = camera.far;
const target = new WebGLRenderTarget(1, 1);
target.depthTexture = new DepthTexture(1, 1);
const screen = new Scene().add(new Mesh(new PlaneGeometry(1, 1), rim));
const flat = new OrthographicCamera();

const build = (side, diameter) => {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(side.positions, 3));
  side.shade = new BufferAttribute(new Uint8Array(3 * side.count), 3, true);
  geometry.setAttribute("shade", side.shade);
  geometry.setAttribute("level", new BufferAttribute(side.level, 1));
  side.material = pointMaterial();
  side.diameter = diameter;
  const points = new Points(geometry, side.material);
  points.frustumCulled = false;
  side.scene = new Scene().add(points);
};
build(before, Math.min(place.spacing, place.side / Math.sqrt(place.before || 1)));
build(after, place.spacing);

const corners = place.borders.flatMap(([west, south, east, north]) =>
  [0, place.height].flatMap((z) => [
    [west, south, z], [east, south, z], [east, south, z], [east, north, z],
    [east, north, z], [west, north, z], [west, north, z], [west, south, z],
  ])).flatMap(([x, y, z]) => [x - place.side / 2, y - place.side / 2, z]);
const lines = new BufferGeometry();
lines.setAttribute("position", new BufferAttribute(new Float32Array(corners), 3));
const borders = new Scene().add(
  new LineSegments(lines, new LineBasicMaterial({ color: 0xff00a0, depthTest: false })),
);

const controls = new OrbitControls(camera, canvas);
controls.listenToKeyEvents(canvas);

/// Returns the middle of the points of `side`, twice their standard deviation from it, and the
/// direction of their largest extent, from above.
const shape = (side) => {
  const at = (i, axis) => side.positions[3 * i + axis];
  const indices = Array.from({ length: side.count }, (_, i) => i);
  const mean = (of) => indices.reduce((sum, i) => sum + of(i), 0) / side.count;
  const [x, y] = [mean((i) => at(i, 0)), mean((i) => at(i, 1))];
  const moment = (a, b) => mean((i) => (at(i, a) - [x, y][a]) * (at(i, b) - [x, y][b]));
  const [xx, xy, yy] = [moment(0, 0), moment(0, 1), moment(1, 1)];
  const turn = 0.5 * Math.atan2(2 * xy, xx - yy);
  return { middle: new Vector3(x, y, 0), radius: 2 * Math.sqrt(xx + yy), along: new Vector3(Math.cos(turn), Math.sin(turn), 0) };
};
const { middle, radius, along } = shape(after);
const up = (height) => new Vector3(0, 0, height);
const views = {
  above: () => [up(1.6 * radius).add(new Vector3(0, -0.01 * radius, 0)), up(0)],
  aslant: () => [new Vector3(-0.6, -0.95, 0.85).multiplyScalar(radius), up(0.3 * place.height)],
  // From within, along the largest extent, above the heads of people.
  street: () => [
    along.clone().multiplyScalar(-0.45 * radius).add(up(0.3 * place.height)),
    along.clone().multiplyScalar(-0.25 * radius).add(up(0.27 * place.height)),
  ],
};
const show = (view) => {
  const [from, to] = views[view]();
  camera.position.copy(from).add(middle);
  controls.target.copy(to).add(middle);
  controls.update();
};

/// The level down to which the output is shown; the last one if there is no choice.
const deepest = () => Number(element("level")?.value ?? 255);
/// Whether all points of the output are shown.
const isWhole = () => !element("level") || deepest() === place.levels.length - 1;
/// The mean distance of the points that are shown over that of all points, as far as they lie on surfaces.
const widening = () => (isWhole() ? 1 : Math.sqrt(place.levels.at(-1) / place.levels[deepest()]));

let isDrawn = false;
const draw = () => {
  isDrawn = false;
  const ratio = Math.min(devicePixelRatio, 2);
  const [wide, high] = [canvas.clientWidth, canvas.clientHeight];
  renderer.setPixelRatio(ratio);
  renderer.setSize(wide, high, false);
  const isStacked = wide < high;
  const [width, height] = isStacked ? [wide, high / 2] : [wide / 2, high];
  camera.aspect = width / height;
  camera.updateProjectionMatrix();
  target.setSize(Math.round(width * ratio), Math.round(height * ratio));
  rim.uniforms.colors.value = target.texture;
  rim.uniforms.depths.value = target.depthTexture;
  rim.uniforms.pixel.value.set(1 / target.width, 1 / target.height);
  rim.uniforms.paper.value.setStyle(getComputedStyle(document.body).backgroundColor, "");
  const pixels = target.height / 2 / Math.tan((camera.fov * Math.PI) / 360);
  [before, after].forEach((side, k) => {
    const wider = side === after ? widening() : 1;
    side.material.uniforms.diameter.value = side.diameter * wider * Number(element("size").value);
    side.material.uniforms.pixels.value = pixels;
    renderer.setRenderTarget(target);
    renderer.clear();
    renderer.render(side.scene, camera);
    renderer.setRenderTarget(null);
    // The origin of a viewport is at the bottom.
    renderer.setViewport(isStacked ? 0 : k * width, isStacked ? (1 - k) * height : 0, width, height);
    renderer.render(screen, flat);
    if (element("borders").checked) renderer.render(borders, camera);
  });
  document.body.dataset.isStacked = isStacked;
  canvas.dataset.drawn = Number(canvas.dataset.drawn ?? 0) + 1;
};
const redraw = () => {
  if (!isDrawn) requestAnimationFrame(draw);
  isDrawn = true;
};
const recolor = () => {
  const coloring = colorings[element("by").value];
  for (const side of [before, after]) {
    for (let i = 0; i < side.count; i++) side.shade.array.set(coloring.of(side, i), 3 * i);
    side.shade.needsUpdate = true;
  }
  element("legend").innerHTML = coloring.legend([before, after]);
  redraw();
};

controls.addEventListener("change", redraw);
addEventListener("resize", redraw);
matchMedia("(prefers-color-scheme:dark)").addEventListener("change", redraw);
element("by").addEventListener("change", recolor);
element("size").addEventListener("input", redraw);
element("borders").addEventListener("change", redraw);
const showLevel = () => {
  const number = (count) => String(count).replace(/\B(?=(\d{3})+$)/g, "\u202f");
  after.material.uniforms.deepest.value = deepest();
  element("level-says").textContent = `0 to ${deepest()}: ${number(place.levels[deepest()])} of ${number(place.levels.at(-1))} points`;
  redraw();
};
element("level")?.addEventListener("input", showLevel);
if (element("level")) showLevel();
for (const view of Object.keys(views)) element(view).addEventListener("click", () => show(view));
canvas.addEventListener("keydown", (event) => {
  const nearer = { "+": 0.9, "=": 0.9, "-": 1 / 0.9 }[event.key];
  if (!nearer) return;
  camera.position.sub(controls.target).multiplyScalar(nearer).add(controls.target);
  controls.update();
});
show("aslant");
recolor();
