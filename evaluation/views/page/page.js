"use strict";
(() => {
  const DATA = JSON.parse(document.getElementById("data").textContent);
  const PALETTE = DATA.palette;
  const $ = (id) => document.getElementById(id);
  const canvas = $("scene"), slider = $("slider"), chooser = $("run"), diagram = $("diagram");
  const AHEAD_M = 42, BEHIND_M = 9, ZOOM_STEP = 1.25, NARROW_PX = 600;
  const LAYERS = [
    ["areas", "monitored area"], ["path", "way of the ego"], ["forecasts", "forecasts"],
    ["truth", "ground truth"], ["detections", "detections"], ["tracks", "tracks"], ["signals", "traffic signals"],
  ];
  const shown = Object.fromEntries(LAYERS.map(([key]) => [key, true]));
  const loaded = new Map();
  const layer = document.createElement("canvas");
  let run = null, frame = 0, zoom = 1, playing = false, playedS = 0, lastTick = 0, cursorPending = false;

  // ---- reading ------------------------------------------------------------------------------------

  async function inflate(id) {
    const bytes = Uint8Array.from(atob($(id).textContent), (letter) => letter.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
    return JSON.parse(await new Response(stream).text());
  }

  function restored(steps, perUnit) {
    const values = new Float64Array(steps.length);
    let sum = 0;
    for (let k = 0; k < steps.length; k++) values[k] = (sum += steps[k]) / perUnit;
    return values;
  }

  function outline(steps, first = 0) {
    const path = new Path2D();
    let x = 0, y = 0;
    for (let k = first; k + 1 < steps.length; k += 2) {
      x += steps[k];
      y += steps[k + 1];
      path.lineTo(x / 100, y / 100);
    }
    path.closePath();
    return path;
  }

  const PER_UNIT = { x: 100, y: 100, l: 100, w: 100, v: 100, b: 100, a: 1000, h: 1000, i: 1, f: 1 };

  function table(packed) {
    const columns = {};
    for (const [name, perUnit] of Object.entries(PER_UNIT))
      if (packed[name]) columns[name] = restored(packed[name], perUnit);
    return columns;
  }

  function objects(packed, frames) {
    const columns = table(packed);
    const label = restored(packed.label, 1), category = restored(packed.category, 1);
    const rows = Array.from({ length: frames }, () => []);
    for (let k = 0; k < packed.f.length; k++) {
      const row = { label: packed.labels[label[k]], category: packed.categories[category[k]] };
      for (const name in columns) row[name] = columns[name][k];
      rows[row.f].push(row);
    }
    return rows;
  }

  const grounds = new Map([[-1, { lanes: [], crosswalks: [] }]]);

  async function loadGround(index) {
    if (!grounds.has(index)) {
      const packed = await inflate("map-" + index);
      grounds.set(index, {
        lanes: packed.lanes.map(([kind, steps]) => [kind, outline(steps)]),
        crosswalks: packed.crosswalks.map((steps) => outline(steps)),
      });
    }
    return grounds.get(index);
  }

  async function load(index) {
    if (loaded.has(index)) return loaded.get(index);
    const packed = await inflate("run-" + index);
    const timeS = restored(packed.t, 1000);
    const kinds = Object.entries(packed.objects).map(([kind, rows]) => [kind, objects(rows, timeS.length)]);
    const found = {
      index, timeS, ego: table(packed.ego), objects: Object.fromEntries(kinds),
      areas: packed.areas.map((rings) => rings.map((steps) => [packed.roles[steps[0]], outline(steps, 1)])),
      first: packed.first, roles: packed.roles, stories: packed.stories, story: restored(packed.story, 1), status: packed.status,
      events: packed.events, signals: packed.signals, diagram: packed.diagram, ground: await loadGround(DATA.maps[index]),
    };
    loaded.set(index, found);
    return found;
  }

  // ---- drawing ------------------------------------------------------------------------------------

  function view() {
    const width = canvas.clientWidth, height = canvas.clientHeight, up = width < NARROW_PX;
    const scale = ((up ? height : width) / (AHEAD_M + BEHIND_M)) * zoom;
    const share = BEHIND_M / (AHEAD_M + BEHIND_M);
    const [cx, cy] = up ? [width / 2, height * (1 - share)] : [width * share, height / 2];
    const x = run.ego.x[frame], y = run.ego.y[frame];
    const c = Math.cos(run.ego.a[frame]) * scale, s = Math.sin(run.ego.a[frame]) * scale;
    const m = up ? [s, -c, -c, -s] : [c, s, s, -c];
    return { up, scale, m: [...m, cx - m[0] * x - m[2] * y, cy - m[1] * x - m[3] * y], width, height };
  }

  const toScreen = (m, x, y) => [m[0] * x + m[2] * y + m[4], m[1] * x + m[3] * y + m[5]];

  function boxPath(row) {
    const path = new Path2D(), c = Math.cos(row.a), s = Math.sin(row.a);
    for (const [i, k] of [[1, 1], [-1, 1], [-1, -1], [1, -1]]) {
      const l = (i * row.l) / 2, w = (k * row.w) / 2;
      path.lineTo(row.x + c * l - s * w, row.y + s * l + c * w);
    }
    path.closePath();
    return path;
  }

  function draw() {
    const ratio = window.devicePixelRatio || 1;
    const width = canvas.clientWidth, height = Math.round(width < NARROW_PX ? width * 1.3 : Math.min(width * 0.48, 560));
    if (!width) return; // before the page is laid out, or while it is turned
    if (canvas.style.height !== height + "px") canvas.style.height = height + "px";
    if (canvas.width !== Math.round(width * ratio)) canvas.width = Math.round(width * ratio);
    if (canvas.height !== Math.round(height * ratio)) canvas.height = Math.round(height * ratio);
    const pen = canvas.getContext("2d"), seen = view(), px = 1 / seen.scale;
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.fillStyle = "#fbfbf8";
    pen.fillRect(0, 0, width, height);
    pen.transform(...seen.m);
    pen.lineJoin = "round";
    drawGround(pen, px);
    if (shown.areas) drawAreas(pen, px);
    if (shown.path) drawWay(pen, px);
    if (shown.forecasts) drawForecasts(pen, px);
    const rows = (kind) => run.objects[kind][frame];
    if (shown.detections) for (const row of rows("detection")) {
      const [face, edge] = PALETTE.detections[row.label] || ["#fff", "#000"];
      drawBox(pen, row, face, edge, 1.2 * px);
    }
    if (shown.truth) for (const row of rows("actor")) drawBox(pen, row, null, "#000", px, [2 * px, 2 * px]);
    if (shown.tracks) for (const row of rows("track"))
      drawBox(pen, row, null, trackColour(row), (row.label === "threat" ? 3 : 2) * px);
    drawEgo(pen, px);
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    if (shown.signals) drawSignals(pen, seen);
    if (shown.tracks) drawTrackMarks(pen, seen);
    drawScale(pen, seen);
  }

  const trackColour = (row) => PALETTE.tracks[row.label] || "#555";

  function drawBox(pen, row, face, edge, width, dash = []) {
    const path = boxPath(row);
    if (face) { pen.fillStyle = face; pen.fill(path); }
    pen.strokeStyle = edge;
    pen.lineWidth = width;
    pen.setLineDash(dash);
    pen.stroke(path);
    pen.setLineDash([]);
  }

  function drawGround(pen, px) {
    pen.lineWidth = 0.6 * px;
    for (const [kind, path] of run.ground.lanes) {
      pen.fillStyle = PALETTE.lanes[kind] || PALETTE.other;
      pen.fill(path);
      pen.strokeStyle = "#b5b5b5";
      pen.stroke(path);
    }
    for (const path of run.ground.crosswalks) {
      pen.fillStyle = "#fff";
      pen.fill(path);
      pen.strokeStyle = "#7a7a7a";
      pen.stroke(path);
    }
  }

  // All areas on a layer of their own, the first of the palette on top, which is then laid over the ground
  // as a whole: where areas overlap, one colour is seen and not a mixture of all.
  function drawAreas(pen, px) {
    const areas = run.areas[frame] || [], known = Object.keys(PALETTE.areas);
    const rank = (role) => (known.includes(role) ? known.indexOf(role) : known.length);
    const ordered = [...areas].sort((a, b) => rank(b[0]) - rank(a[0]));
    const colour = (role) => PALETTE.areas[role] || "#8c8c8c";
    layer.width = canvas.width;
    layer.height = canvas.height;
    const brush = layer.getContext("2d");
    brush.setTransform(pen.getTransform());
    for (const [role, path] of ordered) {
      brush.fillStyle = colour(role);
      brush.fill(path);
    }
    pen.save();
    pen.setTransform(1, 0, 0, 1, 0, 0);
    pen.globalAlpha = 0.3;
    pen.drawImage(layer, 0, 0);
    pen.restore();
    pen.lineWidth = px;
    pen.globalAlpha = 0.45;
    for (const [role, path] of ordered) {
      pen.strokeStyle = colour(role);
      pen.stroke(path);
    }
    pen.globalAlpha = 1;
  }

  function drawWay(pen, px) {
    const { x, y } = run.ego;
    for (const [from, to, dash] of [[0, frame, []], [frame, x.length - 1, [6 * px, 5 * px]]]) {
      pen.beginPath();
      for (let k = from; k <= to; k++) pen.lineTo(x[k], y[k]);
      pen.strokeStyle = "#555";
      pen.lineWidth = 1.3 * px;
      pen.setLineDash(dash);
      pen.stroke();
    }
    pen.setLineDash([]);
  }

  function drawForecasts(pen, px) {
    const tracks = new Map(run.objects.track[frame].map((row) => [row.i, row]));
    const fade = (row, last) => 0.85 - 0.55 * Math.min(row.h / last, 1);
    for (const kind of ["ego_forecast", "forecast"]) {
      const rows = run.objects[kind][frame];
      const last = Math.max(...rows.map((row) => row.h), 0.5);
      for (const row of rows) {
        const track = tracks.get(row.i);
        pen.globalAlpha = fade(row, last);
        drawBox(pen, row, null, kind === "forecast" && track ? trackColour(track) : PALETTE.ego, px);
      }
    }
    pen.globalAlpha = 1;
  }

  function drawEgo(pen, px) {
    const own = {};
    for (const name of ["x", "y", "a", "l", "w"]) own[name] = run.ego[name][frame];
    drawBox(pen, own, PALETTE.ego, "#000", px);
    const c = Math.cos(own.a), s = Math.sin(own.a);
    const bar = (along, length, colour) => {
      const x = own.x + c * along * own.l, y = own.y + s * along * own.l;
      drawBox(pen, { x, y, a: own.a, l: length, w: own.w * 0.92 }, colour, colour, 0);
    };
    bar(0.2, 0.5, "#cfd8dd");
    if (run.ego.b && run.ego.b[frame] < -0.5) bar(-0.47, 0.35, "#ff5a1f");
  }

  // What each traffic signal shows now: the last of its changes up to this frame.
  function drawSignals(pen, seen) {
    const now = new Map(run.signals.filter(([from]) => from <= frame).map((change) => [change[1], change]));
    pen.font = "12px system-ui, sans-serif";
    pen.textBaseline = "middle";
    const drawn = [];
    for (const [, signal, lamp, atX, atY] of now.values()) {
      let [x, y] = toScreen(seen.m, atX / 100, atY / 100);
      while (drawn.some(([otherX, otherY]) => Math.abs(x - otherX) < 16 && Math.abs(y - otherY) < 16)) y += 17;
      drawn.push([x, y]);
      if (x < -20 || y < -20 || x > seen.width + 20 || y > seen.height + 20) continue;
      pen.beginPath();
      pen.arc(x, y, 6.5, 0, 2 * Math.PI);
      pen.fillStyle = PALETTE.signals[lamp] || PALETTE.signals.off;
      pen.fill();
      pen.strokeStyle = PALETTE.housing;
      pen.lineWidth = 3;
      pen.stroke();
      pen.lineWidth = 3.5;
      pen.strokeStyle = "#fff";
      pen.strokeText(`${signal}: ${lamp}`, x + 11, y);
      pen.fillStyle = "#1d2328";
      pen.fillText(`${signal}: ${lamp}`, x + 11, y);
    }
  }

  function drawTrackMarks(pen, seen) {
    const rows = [...run.objects.track[frame]].sort((a, b) => (b.label === "threat") - (a.label === "threat"));
    const taken = [];
    pen.font = "12px system-ui, sans-serif";
    pen.textBaseline = "middle";
    for (const row of rows) {
      const [x, y] = toScreen(seen.m, row.x, row.y), colour = trackColour(row);
      if (x < 0 || y < 0 || x > seen.width || y > seen.height) {
        if (row.label === "threat") pointTo(pen, seen, x, y, colour);
        continue;
      }
      if (row.v > 0.2 && row.label !== "static") drawArrow(pen, seen, row, colour);
      if (row.label === "threat") {
        pen.beginPath();
        pen.arc(x, y, Math.max(14, seen.scale * 0.9), 0, 2 * Math.PI);
        pen.strokeStyle = colour;
        pen.lineWidth = 2.5;
        pen.stroke();
      }
      const text = `${row.category} ${row.i}`, wide = pen.measureText(text).width;
      const places = labelPlaces(seen, x, y, wide);
      const place = places.find((box) => !taken.some((other) =>
        box[0] < other[2] && other[0] < box[2] && box[1] < other[3] && other[1] < box[3]));
      if (!place) continue;
      taken.push(place);
      pen.lineWidth = 3.5;
      pen.strokeStyle = "#fff";
      pen.strokeText(text, place[0], place[1] + 8);
      pen.fillStyle = "#1d2328";
      pen.fillText(text, place[0], place[1] + 8);
    }
  }

  // A threat outside the view: a wedge at the edge, towards it.
  function pointTo(pen, seen, x, y, colour) {
    const atX = Math.max(16, Math.min(x, seen.width - 16)), atY = Math.max(16, Math.min(y, seen.height - 16));
    const turn = Math.atan2(y - atY, x - atX);
    pen.fillStyle = colour;
    pen.beginPath();
    for (const side of [0, 2.4, -2.4]) pen.lineTo(atX + 13 * Math.cos(turn + side), atY + 13 * Math.sin(turn + side));
    pen.fill();
  }

  // Away from the ego's way first, so that texts stay beside the road.
  function labelPlaces(seen, x, y, wide) {
    const [egoX, egoY] = toScreen(seen.m, run.ego.x[frame], run.ego.y[frame]);
    const right = x + 16, left = x - 16 - wide, above = y < egoY ? [-16, 18, -34, 36] : [18, -16, 36, -34];
    const spots = seen.up
      ? [0, -16, 16, -32, 32].flatMap((dy) => (x < egoX ? [left, right] : [right, left]).map((at) => [at, y + dy]))
      : above.map((dy) => [right - 10, y + dy]);
    return spots
      .map(([at, middle]) => [Math.max(2, Math.min(at, seen.width - wide - 4)), middle])
      .map(([at, middle]) => [at, middle - 8, at + wide, middle + 8]);
  }

  function drawArrow(pen, seen, row, colour) {
    const [x0, y0] = toScreen(seen.m, row.x, row.y);
    const [x1, y1] = toScreen(seen.m, row.x + row.v * Math.cos(row.a), row.y + row.v * Math.sin(row.a));
    const turn = Math.atan2(y1 - y0, x1 - x0);
    pen.strokeStyle = pen.fillStyle = colour;
    pen.lineWidth = 1.6;
    pen.beginPath();
    pen.moveTo(x0, y0);
    pen.lineTo(x1, y1);
    pen.stroke();
    pen.beginPath();
    for (const side of [0, 2.6, -2.6]) pen.lineTo(x1 + 7 * Math.cos(turn + side), y1 + 7 * Math.sin(turn + side));
    pen.fill();
  }

  function drawScale(pen, seen) {
    const length = 10 * seen.scale, x = 14, y = seen.height - 14;
    pen.strokeStyle = pen.fillStyle = "#1d2328";
    pen.lineWidth = 2;
    pen.beginPath();
    pen.moveTo(x, y - 4); pen.lineTo(x, y); pen.lineTo(x + length, y); pen.lineTo(x + length, y - 4);
    pen.stroke();
    pen.font = "12px system-ui, sans-serif";
    pen.textBaseline = "bottom";
    pen.fillText("10 m", x + 4, y - 4);
  }

  // ---- moving through a run -----------------------------------------------------------------------

  function seek(wanted) {
    frame = Math.max(0, Math.min(run.timeS.length - 1, wanted));
    const time = run.timeS[frame].toFixed(2) + " s";
    slider.value = frame;
    slider.setAttribute("aria-valuetext", time);
    canvas.dataset.frame = frame;
    $("clock").textContent = time;
    $("moment").href = linkTo(DATA.logs[run.index], run.timeS[frame]);
    $("status").textContent = run.status[frame];
    const story = run.stories[run.story[frame]];
    if ($("story").textContent !== story) $("story").textContent = story;
    let current = -1;
    run.events.forEach((event, k) => { if (event[0] <= frame) current = k; });
    [...$("events").children].forEach((button, k) => button.setAttribute("aria-current", String(k === current)));
    draw();
    moveCursor();
  }

  // ---- links to a run and a time --------------------------------------------------------------------

  const linkTo = (log, timeS) => "#" + new URLSearchParams({ run: log, t: Number(timeS.toFixed(3)) });

  // Opens what the address asks for: #run=NAME&t=SECONDS; whether it asks for a run of this page.
  async function follow({ scroll }) {
    const asked = new URLSearchParams(location.hash.slice(1)), log = asked.get("run");
    if (log === null) return false;
    if (!DATA.logs.includes(log)) {
      $("finding").textContent = `The link is to the run ${log}, whose replay is not in this page.`;
      return false;
    }
    await open(log, { scroll, timeS: asked.has("t") ? Number(asked.get("t")) : NaN });
    return true;
  }

  function moveCursor() {
    if (cursorPending || !diagram.data) return;
    cursorPending = true;
    requestAnimationFrame(async () => {
      cursorPending = false;
      const time = run.timeS[frame];
      await Plotly.relayout(diagram, { "shapes[0].x0": time, "shapes[0].x1": time });
    });
  }

  function play(wanted) {
    if (!run) return;
    if (wanted && frame === run.timeS.length - 1) seek(0);
    playing = wanted;
    playedS = run.timeS[frame];
    lastTick = performance.now();
    $("play").textContent = playing ? "Pause" : "Play";
    $("play").setAttribute("aria-label", playing ? "Pause" : "Play");
    $("story").setAttribute("aria-live", playing ? "off" : "polite");
    if (playing) requestAnimationFrame(tick);
  }

  function tick(now) {
    if (!playing) return;
    playedS += ((now - lastTick) / 1000) * Number($("rate").value);
    lastTick = now;
    let next = frame;
    while (next + 1 < run.timeS.length && run.timeS[next + 1] <= playedS) next++;
    if (next !== frame) seek(next);
    if (frame === run.timeS.length - 1) play(false);
    else requestAnimationFrame(tick);
  }

  function step(by) {
    play(false);
    seek(frame + by);
  }

  function zoomBy(factor) {
    zoom = Math.max(0.4, Math.min(6, zoom * factor));
    draw();
  }

  // A run opens where it shows why it ended so, with what it was for in view.
  function showThreats() {
    const threats = run.objects.track[frame].filter((row) => row.label === "threat"), rim = 24;
    const hidden = (seen) => threats.some((row) => {
      const [x, y] = toScreen(seen.m, row.x, row.y);
      return x < rim || y < rim || x > seen.width - rim || y > seen.height - rim;
    });
    for (zoom = 1; zoom > 0.5 && hidden(view()); ) zoom /= ZOOM_STEP;
    draw();
  }

  async function open(log, { scroll = false, timeS = NaN } = {}) {
    const index = DATA.logs.indexOf(log);
    if (index < 0) return;
    play(false);
    run = await load(index);
    chooser.value = log;
    slider.max = run.timeS.length - 1;
    $("finding").textContent = $("what-" + index).textContent;
    for (const button of document.querySelectorAll(".matrix button"))
      button.setAttribute("aria-current", String(button.dataset.log === log));
    listEvents();
    listLegend();
    await drawDiagram();
    seek(Number.isFinite(timeS) ? frameAt(timeS) : run.first);
    showThreats();
    if (scroll) $("replay").scrollIntoView();
    document.body.dataset.run = log;
  }

  function listEvents() {
    $("events").replaceChildren(...run.events.map(([at, time, , name]) => {
      const button = document.createElement("button"), when = document.createElement("b");
      button.type = "button";
      when.textContent = time.toFixed(2) + " s ";
      button.append(when, name.replaceAll("_", " "));
      button.addEventListener("click", () => { play(false); seek(at); });
      return button;
    }));
  }

  function chip(colour, edge, text) {
    const item = document.createElement("span"), mark = document.createElement("i");
    item.className = "fixed";
    mark.style.background = colour;
    mark.style.borderColor = edge;
    item.append(mark, text);
    return item;
  }

  function listLegend() {
    const boxes = LAYERS.filter(([key]) => key !== "signals" || run.signals.length).map(([key, text]) => {
      const label = document.createElement("label"), box = document.createElement("input");
      box.type = "checkbox";
      box.checked = shown[key];
      box.addEventListener("change", () => { shown[key] = box.checked; draw(); });
      label.append(box, text);
      return label;
    });
    const lanes = [...new Set(run.ground.lanes.map(([kind]) => kind))].filter((kind) => PALETTE.lanes[kind]);
    $("legend").replaceChildren(
      ...boxes,
      chip(PALETTE.ego, "#000", "ego (orange bar: braking)"),
      ...run.roles.map((role) => chip(PALETTE.areas[role] + "55", PALETTE.areas[role], "monitored: " + role.replaceAll("_", " "))),
      ...Object.entries(PALETTE.detections).map(([name, [face, edge]]) => chip(face, edge, "detection " + name)),
      ...Object.entries(PALETTE.tracks).map(([name, edge]) => chip("transparent", edge, "track, " + name)),
      ...lanes.map((kind) => chip(PALETTE.lanes[kind], "#b5b5b5", kind + " lane")),
    );
  }

  // Charts in the colours of the page: in the dark, what is black is light, and lines of the grid are dark.
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const LIGHT_TO_DARK = {
    white: "#14181b", "#ffffff": "#14181b", "#000000": "#e8ebee", "#222222": "#e8ebee", "#1d2328": "#e8ebee",
    "#e6e6e6": "#2c343b", "#999999": "#8b96a1", "#444444": "#c3cad1", "#555555": "#c3cad1", "#882255": "#d76aa0",
  };

  function themed(value) {
    if (!dark.matches) return value;
    if (typeof value === "string") return LIGHT_TO_DARK[value] || value;
    if (Array.isArray(value)) return value.map(themed);
    if (value === null || typeof value !== "object") return value;
    return Object.fromEntries(Object.entries(value).map(([key, part]) => [key, themed(part)]));
  }

  async function drawDiagram() {
    const layout = themed({ ...run.diagram.layout, shapes: [{
      type: "line", xref: "x", yref: "paper", x0: 0, x1: 0, y0: 0, y1: 1, line: { color: "#1d2328", width: 1.2, dash: "dot" },
    }] });
    const fresh = !diagram.data;
    // On a phone the names would cover each other; they stand in the list of events above.
    const narrow = diagram.clientWidth < NARROW_PX;
    const data = run.diagram.data.map((trace) => themed(narrow && trace.name === "events" ? { ...trace, mode: "markers" } : trace));
    await Plotly.react(diagram, data, layout, { responsive: true, displayModeBar: false });
    if (fresh) diagram.on("plotly_click", (event) => {
      play(false);
      seek(frameAt(event.points[0].x));
    });
  }

  function frameAt(time) {
    let found = 0;
    run.timeS.forEach((t, k) => { if (t <= time + 1e-6) found = k; });
    return found;
  }

  async function drawPanels() {
    for (const [k, spec] of DATA.panels.entries()) {
      const panel = $("panel-" + k);
      await Plotly.newPlot(panel, themed(spec.data), themed(spec.layout), { responsive: true, displayModeBar: false });
      panel.on("plotly_click", (event) => open(event.points[0].data.meta, { scroll: true }));
    }
  }

  // ---- controls -----------------------------------------------------------------------------------

  function onKey(event) {
    const target = event.target, typing = target.matches("select, input, button, a, [contenteditable]");
    if (event.ctrlKey || event.metaKey || event.altKey || !run) return;
    if (!inSight && !$("replay").contains(target)) return;
    const own = target === slider || target === canvas;
    const act = {
      ArrowLeft: () => step(-1), ArrowRight: () => step(1), Home: () => step(-Infinity), End: () => step(Infinity),
      " ": () => play(!playing), "+": () => zoomBy(ZOOM_STEP), "=": () => zoomBy(ZOOM_STEP), "-": () => zoomBy(1 / ZOOM_STEP),
    }[event.key];
    if (!act || (typing && !own)) return;
    event.preventDefault();
    act();
  }

  let inSight = false;
  new IntersectionObserver(([entry]) => { inSight = entry.isIntersecting; }).observe($("stage"));
  canvas.tabIndex = 0;
  document.addEventListener("keydown", onKey);
  document.addEventListener("click", (event) => {
    const button = event.target.closest("button[data-log]");
    if (button) open(button.dataset.log, { scroll: true });
  });
  slider.addEventListener("input", () => { play(false); seek(Number(slider.value)); });
  chooser.addEventListener("change", () => open(chooser.value));
  $("play").addEventListener("click", () => play(!playing));
  $("back").addEventListener("click", () => step(-1));
  $("forward").addEventListener("click", () => step(1));
  $("closer").addEventListener("click", () => zoomBy(ZOOM_STEP));
  $("farther").addEventListener("click", () => zoomBy(1 / ZOOM_STEP));
  new ResizeObserver(() => { if (run) draw(); }).observe($("stage"));
  dark.addEventListener("change", async () => {
    if (run) await drawDiagram();
    await drawPanels();
  });

  async function start() {
    if (typeof DecompressionStream === "undefined") {
      $("story").textContent = "This browser is too old for the replay: it cannot unpack data (DecompressionStream).";
      return;
    }
    if (!location.hash.startsWith("#run=") || !(await follow({ scroll: true }))) {
      const note = $("finding").textContent;
      await open(DATA.logs[DATA.first]);
      if (note) $("finding").textContent = note;
    }
    window.addEventListener("hashchange", () => follow({ scroll: true }));
    await drawPanels();
    document.body.dataset.ready = "true";
  }
  start();
})();
