
// The mesh of the output: its triangles, by the indices of their corners among the points of `after`. They share the
// positions and the colours of the points. This follows `viewer.js` in the same module, on pages with a mesh.

/// Returns the corners of the triangles: 12 planes, one for each byte of the three numbers of a triangle. The first
/// corner is counted from that of the triangle before, the others from the first one.
const unpackTriangles = async (count) => {
  const packed = Uint8Array.from(atob(element("triangles").textContent), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  const corners = new Uint32Array(3 * count);
  const number = (k, i) => {
    const byte = (b) => bytes[(4 * k + b) * count + i];
    return byte(0) | (byte(1) << 8) | (byte(2) << 16) | (byte(3) << 24);
  };
  for (let i = 0, first = 0; i < count; i++) {
    first += number(0, i);
    corners.set([first, first + number(1, i), first + number(2, i)], 3 * i);
  }
  return corners;
};

// Light comes from the eye and a little from above and the left, and wraps around: walls seen at a slant are not black.
// Backs are lit as well, in a colour of their own. Faces step back a little in depth, so that edges are drawn in front.
const faceMaterial = new ShaderMaterial({
  side: 2, // both sides
  polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1,
  vertexShader: `
    attribute vec3 shade; varying vec3 tint, across;
    void main() {
      gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
      across = normalMatrix * normal;
      tint = shade;
    }`,
  fragmentShader: `
    varying vec3 tint, across;
    void main() {
      vec3 front = normalize(across) * (gl_FrontFacing ? 1.0 : -1.0);
      float light = 0.5 + 0.5 * dot(front, normalize(vec3(-0.2, 0.6, 1.0)));
      vec3 color = gl_FrontFacing ? tint : mix(tint, vec3(0.5, 0.56, 0.72), 0.7);
      gl_FragColor = vec4(min(color * (0.45 + 0.7 * light), 1.0), 1.0);
    }`,
});
// Edges are dark on bright colours and bright on dark ones, and fade where they would be nearer to each other than a
// few pixels.
const edgeMaterial = new ShaderMaterial({
  wireframe: true, transparent: true, depthWrite: false,
  uniforms: { spacing: { value: place.spacing }, pixels: { value: 1 } },
  vertexShader: `
    attribute vec3 shade; varying vec3 tint; varying float apart; uniform float spacing, pixels;
    void main() {
      vec4 seen = modelViewMatrix * vec4(position, 1.0);
      gl_Position = projectionMatrix * seen;
      float slant = abs(dot(normalize(normalMatrix * normal), normalize(seen.xyz)));
      apart = slant * spacing * pixels / -seen.z;
      tint = shade;
    }`,
  fragmentShader: `
    varying vec3 tint; varying float apart;
    void main() {
      bool isDark = dot(tint, vec3(0.3, 0.6, 0.1)) < 0.4;
      gl_FragColor = vec4(isDark ? tint + 0.5 : 0.25 * tint, clamp((apart - 2.0) / 14.0, 0.0, 0.7));
    }`,
});

const [points] = after.scene.children;
const surface = new BufferGeometry();
surface.setAttribute("position", points.geometry.getAttribute("position"));
surface.setAttribute("shade", after.shade);
const triangles = await unpackTriangles(place.triangles);
surface.setIndex(new BufferAttribute(triangles, 1));
surface.computeVertexNormals();
// What has no triangle, as leaves and wires, stays a point.
const isCorner = new Uint8Array(after.count);
for (const corner of triangles) isCorner[corner] = 1;
const others = new BufferAttribute(new Uint32Array(after.count).map((_, i) => i).filter((i) => !isCorner[i]), 1);
const faces = new Mesh(surface, faceMaterial);
const edges = new Mesh(surface, edgeMaterial);
edges.onBeforeRender = () => { edgeMaterial.uniforms.pixels.value = after.material.uniforms.pixels.value; };
for (const part of [faces, edges]) part.frustumCulled = false;
after.scene.add(faces, edges);

const showAs = () => {
  const choice = element("as").value;
  canvas.dataset.as = choice;
  // Triangles lie between all points.
  faces.visible = choice !== "points" && isWhole();
  edges.visible = choice === "edges" && isWhole();
  points.geometry.setIndex(faces.visible ? others : null);
  redraw();
};
element("as").addEventListener("change", showAs);
element("level")?.addEventListener("input", showAs);
showAs();
