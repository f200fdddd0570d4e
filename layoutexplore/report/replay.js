// Shows a recorded run again: the map as it grew, frontiers, rooms believed, the way, the coverage curve.
// Everything it needs stands in the page; time is measured in metres travelled.
"use strict";
(() => {
  const data = JSON.parse(document.getElementById("replay-data").textContent);
  const colours = data.colours;
  const $ = (id) => document.getElementById("replay-" + id);
  const map = $("map"), chart = $("curve"), bar = $("bar"), button = $("play");
  const TYPES = {
    int8: Int8Array, uint8: Uint8Array, int16: Int16Array, int32: Int32Array,
    float32: Float32Array, float64: Float64Array,
  };
  let run = null, metres = 0, playing = false, last = 0, drawn = -1, wanted = 0;

  async function unpack(text) {
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    const buffer = await new Response(stream).arrayBuffer();
    const length = new DataView(buffer).getUint32(0, true);
    const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
    const arrays = {};
    for (const [name, type, count, at] of header) {
      const from = 4 + length + at;
      arrays[name] = new TYPES[type](buffer.slice(from, from + count * TYPES[type].BYTES_PER_ELEMENT));
    }
    return arrays;
  }

  const bits = (packed, n) => Uint8Array.from({ length: n }, (_, k) => (packed[k >> 3] >> (7 - (k & 7))) & 1);

  // The number of entries of a rising column that are at most a value.
  function upTo(values, value, stride = 1, column = 0) {
    let low = 0, high = values.length / stride;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (values[middle * stride + column] <= value) low = middle + 1; else high = middle;
    }
    return low;
  }

  async function load(k) {
    const turn = ++wanted;
    const entry = data.runs[k], floor = data.floors[entry.floor];
    const a = await unpack(entry.data);
    const truth = await unpack(floor.data);
    if (turn !== wanted) return; // another run was chosen meanwhile
    const [rows, cols] = floor.shape, cells = rows * cols;
    a.occupied = bits(a.occupied, cells);
    const picture = document.createElement("canvas");
    picture.width = cols; picture.height = rows;
    run = { ...entry, ...floor, rows, cols, a, walls: bits(truth.occupied, cells), picture,
            context: picture.getContext("2d"), end: a.curve[a.curve.length - 2] };
    run.image = run.context.createImageData(cols, rows);
    bar.max = run.end; bar.step = run.end / 1000;
    metres = Math.min(metres, run.end); drawn = -1;
    $("rooms").parentNode.hidden = a.rooms_at.length === 0;
    resize();
    document.getElementById("replay").dataset.state = "ready";
  }

  // Colours of the cells after so many scans, row 0 of the picture at the top: the highest y.
  function paint(scans, decision) {
    const { rows, cols, a, walls } = run, pixels = run.image.data, n = rows * cols;
    const cells = new Int8Array(n).fill(-1);
    let known = 0;
    for (let k = 0; k < n; k++) if (a.first[k] > 0 && a.first[k] <= scans) { cells[k] = a.occupied[k]; known++; }
    for (let k = 0; k < a.flips.length; k += 2) {
      if (a.flips[k] > scans) break;
      cells[a.flips[k + 1]] ^= 1;
    }
    const layer = $("rooms").checked ? upTo(a.rooms_at, decision) - 1 : -1;
    for (let k = 0; k < n; k++) {
      const room = layer < 0 ? 0 : a.rooms[layer * n + k];
      const colour = cells[k] === 1 ? colours.wall
        : cells[k] === 0 ? (room > 0 ? colours.rooms[(room - 1) % colours.rooms.length] : colours.free)
        : room > 0 ? colours.predicted : walls[k] ? colours.canvas : colours.unseen;
      put(pixels, k, colour);
    }
    if (decision >= 0) {
      for (let f = a.shown[decision]; f < a.shown[decision + 1]; f++) {
        const closed = a.frontiers[2 * f + 1], cluster = a.frontiers[2 * f];
        const colour = closed > 0 ? colours.closed : closed < 0 ? colours.open : colours.frontier;
        for (let m = a.clusters[cluster]; m < a.clusters[cluster + 1]; m++) put(pixels, a.members[m], colour);
      }
    }
    run.context.putImageData(run.image, 0, 0);
    map.dataset.known = known; map.dataset.scans = scans; map.dataset.decision = decision;
  }

  function put(pixels, cell, colour) {
    const row = run.rows - 1 - Math.floor(cell / run.cols), at = 4 * (row * run.cols + (cell % run.cols));
    pixels[at] = colour[0]; pixels[at + 1] = colour[1]; pixels[at + 2] = colour[2]; pixels[at + 3] = 255;
  }

  const css = (c) => `rgb(${c[0]},${c[1]},${c[2]})`;

  // A world point in pixels of the canvas; the grid may be turned.
  function place(x, y, scale) {
    const [resolution, x0, y0, theta] = run.frame, dx = x - x0, dy = y - y0;
    const u = (dx * Math.cos(theta) + dy * Math.sin(theta)) / resolution;
    const v = (-dx * Math.sin(theta) + dy * Math.cos(theta)) / resolution;
    return [u * scale, (run.rows - v) * scale];
  }

  function draw() {
    if (!run) return;
    const { a } = run, count = a.curve.length / 2;
    const scans = Math.max(1, upTo(a.curve, metres + 1e-4, 2));
    const decision = upTo(a.decided, scans, 2) - 1;
    const state = scans + " " + decision + " " + $("rooms").checked;
    if (state !== drawn) { paint(scans, decision); drawn = state; }
    const pen = map.getContext("2d"), scale = map.width / run.cols, unit = map.width / map.clientWidth || 1;
    pen.imageSmoothingEnabled = false;
    pen.drawImage(run.picture, 0, 0, map.width, map.height);
    // Where the robot is between two scans.
    const before = a.curve[2 * (scans - 1)], after = scans < count ? a.curve[2 * scans] : before;
    const share = after > before ? Math.min(1, Math.max(0, (metres - before) / (after - before))) : 0;
    const pose = (k) => [a.poses[3 * k], a.poses[3 * k + 1], a.poses[3 * k + 2]];
    const here = pose(scans - 1), next = pose(Math.min(scans, count - 1));
    const x = here[0] + share * (next[0] - here[0]), y = here[1] + share * (next[1] - here[1]);
    pen.lineJoin = pen.lineCap = "round";
    pen.beginPath();
    for (let k = 0; k < scans; k++) pen.lineTo(...place(a.poses[3 * k], a.poses[3 * k + 1], scale));
    pen.lineTo(...place(x, y, scale));
    pen.lineWidth = 2 * unit; pen.strokeStyle = css(colours.track); pen.stroke();
    drawGoal(pen, scale, unit, decision);
    drawRobot(pen, place(x, y, scale), here[2] - run.frame[3], unit);
    drawScale(pen, scale, unit);
    drawCurve(scans);
    bar.value = metres;
    $("said").textContent = said(scans, decision);
  }

  function goalOf(decision) {
    const chosen = decision < 0 ? -1 : run.a.decided[2 * decision + 1];
    return chosen < 0 ? -1 : run.a.shown[decision] + chosen;
  }

  function drawGoal(pen, scale, unit, decision) {
    const { a, rows, cols } = run, goal = goalOf(decision);
    if (goal < 0) return;
    const cluster = a.frontiers[2 * goal], from = a.clusters[cluster], to = a.clusters[cluster + 1];
    let u = 0, v = 0;
    for (let m = from; m < to; m++) { u += (a.members[m] % cols) + 0.5; v += Math.floor(a.members[m] / cols) + 0.5; }
    pen.beginPath();
    pen.arc((u / (to - from)) * scale, (rows - v / (to - from)) * scale, 9 * unit, 0, 7);
    pen.lineWidth = 2.2 * unit; pen.strokeStyle = css(colours.planned); pen.stroke();
  }

  function drawRobot(pen, [x, y], theta, unit) {
    const size = 9 * unit;
    pen.beginPath();
    for (const [turn, length] of [[0, 1], [2.5, 0.95], [Math.PI, 0.35], [-2.5, 0.95]]) {
      pen.lineTo(x + length * size * Math.cos(theta + turn), y - length * size * Math.sin(theta + turn));
    }
    pen.closePath();
    pen.lineWidth = 2 * unit; pen.strokeStyle = "#fff"; pen.stroke();
    pen.fillStyle = css(colours.robot); pen.fill();
  }

  function drawScale(pen, scale, unit) {
    const pixel = run.frame[0] / scale; // metres
    const length = [1, 2, 5, 10, 20, 50, 100].find((m) => m / pixel > 0.14 * map.width) || 200;
    const left = 10 * unit, low = map.height - 10 * unit, wide = length / pixel;
    pen.font = `${12 * unit}px system-ui, sans-serif`; pen.textBaseline = "bottom"; pen.textAlign = "left";
    pen.fillStyle = "rgba(255,255,255,.85)"; pen.fillRect(left - 5 * unit, low - 21 * unit, wide + 10 * unit, 26 * unit);
    pen.fillStyle = css(colours.ink); pen.fillRect(left, low - 3 * unit, wide, 3 * unit);
    pen.fillText(length + " m", left, low - 4 * unit);
  }

  function drawCurve(scans) {
    const pen = chart.getContext("2d"), unit = chart.width / chart.clientWidth || 1, { a, end } = run;
    const left = 52 * unit, right = chart.width - 14 * unit, top = 10 * unit, low = chart.height - 40 * unit;
    const px = (m) => left + ((right - left) * m) / (end || 1), py = (c) => low + (top - low) * c;
    pen.clearRect(0, 0, chart.width, chart.height);
    pen.font = `${12 * unit}px system-ui, sans-serif`; pen.fillStyle = css(colours.faded); pen.strokeStyle = css(colours.rule);
    pen.lineWidth = unit;
    for (const share of [0, 0.25, 0.5, 0.75, 1]) {
      pen.beginPath(); pen.moveTo(left, py(share)); pen.lineTo(right, py(share)); pen.stroke();
      pen.textAlign = "right"; pen.textBaseline = "middle"; pen.fillText(`${100 * share} %`, left - 6 * unit, py(share));
    }
    const step = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000].find((m) => px(m) - left > 44 * unit) || 5000;
    pen.textAlign = "center"; pen.textBaseline = "top";
    for (let m = 0; m <= end; m += step) pen.fillText(m, px(m), low + 5 * unit);
    pen.fillText("metres travelled", (left + right) / 2, low + 22 * unit);
    pen.save(); pen.translate(9 * unit, (top + low) / 2); pen.rotate(-Math.PI / 2); pen.textBaseline = "middle";
    pen.fillText("coverage", 0, 0); pen.restore();
    // pale by letting the page through: on a dark one, too
    for (const [upto, alpha] of [[a.curve.length / 2, 0.4], [scans, 1]]) {
      pen.globalAlpha = alpha; pen.beginPath();
      for (let k = 0; k < upto; k++) pen.lineTo(px(a.curve[2 * k]), py(a.curve[2 * k + 1]));
      pen.lineWidth = 2.2 * unit; pen.strokeStyle = css(colours.track); pen.stroke();
    }
    pen.beginPath(); pen.moveTo(px(metres), top); pen.lineTo(px(metres), low);
    pen.lineWidth = 1.2 * unit; pen.strokeStyle = css(colours.ink); pen.stroke();
  }

  function said(scans, decision) {
    const goal = goalOf(decision), { a } = run, share = a.curve[2 * scans - 1];
    let text = `${metres.toFixed(1)} m, ${(100 * share).toFixed(1)} % seen, decision ${decision + 1} of ${a.decided.length / 2}`;
    if (goal >= 0 && a.frontiers[2 * goal + 1] !== 0) {
      text += a.frontiers[2 * goal + 1] > 0
        ? `: to a frontier judged closed, ${a.areas[goal].toFixed(1)} m² left` : ": to a frontier judged open";
    }
    return text;
  }

  let room = 0;
  function resize() {
    if (!run) return;
    const ratio = window.devicePixelRatio || 1, wide = room = map.parentNode.clientWidth;
    const most = Math.max(220, Math.min(0.7 * window.innerHeight, 560));
    const high = Math.min(most, (wide * run.rows) / run.cols), across = (high * run.cols) / run.rows;
    map.style.width = across + "px"; map.style.height = high + "px";
    map.width = Math.round(across * ratio); map.height = Math.round(high * ratio);
    chart.width = Math.round(chart.clientWidth * ratio); chart.height = Math.round(chart.clientHeight * ratio);
    draw();
  }

  function tick(now) {
    if (!playing) return;
    metres += ((now - last) / 1000) * Number($("speed").value);
    last = now;
    if (metres >= run.end) { metres = run.end; stop(); }
    draw();
    if (playing) requestAnimationFrame(tick);
  }

  function stop() { playing = false; button.textContent = "Play"; }

  button.addEventListener("click", () => {
    if (!run) return;
    if (playing) return stop();
    if (metres >= run.end) metres = 0;
    playing = true; button.textContent = "Pause"; last = performance.now();
    requestAnimationFrame(tick);
  });
  bar.addEventListener("input", () => { metres = Number(bar.value); draw(); });
  $("rooms").addEventListener("change", draw);
  window.addEventListener("resize", resize);
  // A scroll bar that comes with what is drawn makes the page narrower, which is no resize of the window.
  const fit = () => { if (run && map.parentNode.clientWidth !== room) resize(); };
  new ResizeObserver(() => requestAnimationFrame(fit)).observe(map.parentNode);

  const cells = [...new Set(data.runs.map((r) => r.cell))];
  $("cell").append(...cells.map((name) => new Option(name)));
  function choose(cell, agent) {
    const mine = data.runs.filter((r) => r.cell === cell).map((r) => r.agent);
    $("cell").value = cell;
    $("agent").replaceChildren(...mine.map((name) => new Option(name)));
    $("agent").value = mine.includes(agent) ? agent : mine[0];
    const k = data.runs.findIndex((r) => r.cell === cell && r.agent === $("agent").value);
    return load(k).catch((error) => { $("said").textContent = "This browser cannot show replays: " + error; });
  }
  $("cell").addEventListener("change", () => choose($("cell").value, $("agent").value));
  $("agent").addEventListener("change", () => choose($("cell").value, $("agent").value));

  // #replay=NUMBER@METRES shows a run at a place; links of the page use it.
  function follow() {
    const found = /^#replay=(\d+)(?:@([\d.]+))?$/.exec(location.hash);
    const entry = data.runs[found ? Number(found[1]) : 0] || data.runs[0];
    metres = found && found[2] ? Number(found[2]) : 0;
    stop();
    if (found) document.getElementById("replay").scrollIntoView();
    return choose(entry.cell, entry.agent);
  }
  window.addEventListener("hashchange", follow);
  follow();
})();
