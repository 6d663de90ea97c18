// The map of the area: squares coloured by one of their figures. Pointer and arrow keys choose
// the square whose figures are shown. The data stand in the page as JSON.
(() => {
  const data = JSON.parse(document.getElementById("map-data").textContent);
  const canvas = document.getElementById("map");
  const choice = document.getElementById("map-by");
  const outlines = document.getElementById("map-tiles");
  const says = document.getElementById("map-says");
  const legend = document.getElementById("map-legend");
  const area = data.edge * data.edge;
  // Columns of a square: column, row, points in, points out, δ, mean distance in spacings, isolated returns.
  const figures = {
    delta: { of: (s) => s[4], name: "δ" },
    output: { of: (s) => s[3] / area, name: "points of the output per square unit" },
    input: { of: (s) => s[2] / area, name: "points of the input per square unit" },
    spacing: { of: (s) => s[5], name: "mean nearest distance in spacings" },
    isolated: { of: (s) => s[6], name: "isolated returns in a square" },
  };
  const stops = [[38, 70, 140], [40, 130, 160], [90, 170, 120], [220, 190, 70], [235, 120, 40]];
  const size = Math.max(1, Math.min(16, Math.floor(1200 / Math.max(data.columns, data.rows))));
  canvas.width = data.columns * size;
  canvas.height = data.rows * size;
  const at = new Map(data.squares.map((s) => [s[0] + " " + s[1], s]));
  let chosen = null;

  const color = (share) => {
    const place = Math.min(Math.max(share, 0), 1) * (stops.length - 1);
    const low = Math.min(Math.floor(place), stops.length - 2);
    const mix = (k) => Math.round(stops[low][k] + (place - low) * (stops[low + 1][k] - stops[low][k]));
    return `rgb(${mix(0)} ${mix(1)} ${mix(2)})`;
  };
  const text = (value) => (value === null ? "–" : Number(value.toPrecision(4)).toString());

  const draw = () => {
    const pen = canvas.getContext("2d");
    const figure = figures[choice.value];
    const known = data.squares.map(figure.of).filter((v) => v !== null).sort((a, b) => a - b);
    const low = known[Math.floor(0.02 * known.length)] ?? 0;
    const high = known[Math.ceil(0.98 * known.length) - 1] ?? 1;
    pen.clearRect(0, 0, canvas.width, canvas.height);
    for (const square of data.squares) {
      const value = figure.of(square);
      const isHole = square[2] > 0 && square[3] === 0;
      if (value === null && !isHole) continue;
      pen.fillStyle = isHole ? "rgb(200 30 60)" : color((value - low) / (high - low || 1));
      pen.fillRect(square[0] * size, (data.rows - 1 - square[1]) * size, size, size);
    }
    const y = (north) => data.rows * size - north * size;
    if (outlines.checked) {
      pen.strokeStyle = "rgb(128 128 128 / 0.8)";
      for (const [west, south, east, north] of data.tiles) {
        pen.strokeRect(west * size, y(north), (east - west) * size, (north - south) * size);
      }
    }
    if (chosen) {
      pen.strokeStyle = "rgb(255 0 160)";
      pen.lineWidth = 2;
      pen.strokeRect(chosen[0] * size, (data.rows - 1 - chosen[1]) * size, size, size);
      pen.lineWidth = 1;
    }
    legend.textContent =
      `${figure.name}: from ${text(low)} (blue) to ${text(high)} (orange); red: input without output`;
  };
  const choose = (column, row) => {
    chosen = [
      Math.min(Math.max(column, 0), data.columns - 1),
      Math.min(Math.max(row, 0), data.rows - 1),
    ];
    const square = at.get(chosen.join(" "));
    const corner = chosen.map((c, axis) => (data.corner[axis] + c * data.edge).toFixed(2));
    says.textContent = square
      ? `at ${corner.join(", ")}: ${square[2]} points of the input, ${square[3]} of the output, δ ${text(square[4])}, ` +
        `mean distance ${text(square[5])} spacings, ${square[6]} isolated returns`
      : `at ${corner.join(", ")}: no input`;
    draw();
  };
  canvas.addEventListener("pointermove", (event) => {
    const box = canvas.getBoundingClientRect();
    const column = Math.floor(((event.clientX - box.left) / box.width) * data.columns);
    const row = data.rows - 1 - Math.floor(((event.clientY - box.top) / box.height) * data.rows);
    choose(column, row);
  });
  canvas.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (!step) return;
    event.preventDefault();
    const [column, row] = chosen ?? [data.columns >> 1, data.rows >> 1];
    choose(column + step[0], row + step[1]);
  });
  choice.addEventListener("change", draw);
  outlines.addEventListener("change", draw);
  draw();
})();
