"use strict";
// The player: time, camera, readings and keys. What is drawn is `solid` (scene.js, WebGL) or, without WebGL, `plan` (plan.js).
// The scene is the JSON of coadjoint/plotting/scene.py: lengths in m, times in s, quaternions x, y, z, w from body to space.

const given = JSON.parse(document.getElementById("scene").textContent);
const part = id => document.getElementById(id);
const clamp = (x, low, high) => Math.min(Math.max(x, low), high);
const members = given.members.map(prepared);
const first = Math.min(...members.map(m => m.time[0])), last = Math.max(...members.map(m => m.time.at(-1)));
const time = { now: first, playing: !matchMedia("(prefers-reduced-motion: reduce)").matches, rate: 1 };
const camera = { yaw: 0.7, pitch: 0.45, zoom: 1, follow: -1, tall: 1, frames: given.frames };
const extent = bounds();
let changed = true;

function prepared(member) {
  const bodies = member.bodies.map(b => ({ ...b, place: Float32Array.from(b.place.flat()), turn: Float32Array.from(b.turn.flat()) }));
  return { ...member, bodies, index: 0, part: 0 };
}
function bounds() {
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  const include = (x, k, room) => { low[k] = Math.min(low[k], x - room); high[k] = Math.max(high[k], x + room); };
  members.forEach(m => m.bodies.forEach(b => b.place.forEach((x, i) => include(x, i % 3, b.size / 2))));
  given.wayPoints.forEach(p => p.forEach((x, k) => include(x, k, 0)));
  given.pivot?.forEach((x, k) => include(x, k, 0.9 * members[0].bodies[0].size));
  const wide = Math.max(high[0] - low[0], high[1] - low[1]), deep = high[2] - low[2];
  return { low, high, wide, deep, middle: low.map((x, k) => (x + high[k]) / 2), size: Math.max(wide, deep, 1e-6) };
}

/** Where the member is among its nodes at the present time: `index`, and how much of the way to the next one. */
function locate(member) {
  const t = member.time;
  let i = member.index;
  if (!(t[i] <= time.now && time.now <= t[i + 1])) {
    let low = 0, high = t.length - 1;
    while (high - low > 1) { const k = (low + high) >> 1; if (t[k] <= time.now) low = k; else high = k; }
    i = Math.min(low, t.length - 2);
  }
  member.index = i;
  member.part = clamp((time.now - t[i]) / (t[i + 1] - t[i]), 0, 1);
}
const between = (values, m) => values[m.index] + m.part * (values[m.index + 1] - values[m.index]);
function placeOf(member, body, out) {
  const i = 3 * member.index, p = body.place;
  for (let k = 0; k < 3; k++) out[k] = p[i + k] + member.part * (p[i + 3 + k] - p[i + k]);
  return out;
}
/** The attitude between two nodes: the mean of their quaternions, made a unit one. */
function turnOf(member, body, out) {
  const i = 4 * member.index, q = body.turn;
  const sign = q[i] * q[i + 4] + q[i + 1] * q[i + 5] + q[i + 2] * q[i + 6] + q[i + 3] * q[i + 7] < 0 ? -1 : 1;
  for (let k = 0; k < 4; k++) out[k] = (1 - member.part) * q[i + k] + sign * member.part * q[i + 4 + k];
  const size = Math.hypot(...out);
  for (let k = 0; k < 4; k++) out[k] /= size;
  return out;
}

// Colours: those of all figures, made darker or paler until they stand out from the ground, 3 : 1 (WCAG 2.1, 1.4.11).
const css = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const channels = hex => [1, 3, 5].map(i => parseInt(hex.slice(i, i + 2), 16));
function luminance(rgb) {
  const [r, g, b] = rgb.map(c => (c /= 255) <= 0.03928 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4);
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
}
function contrast(a, b) {
  const [low, high] = [luminance(a), luminance(b)].sort((x, y) => x - y);
  return (high + 0.05) / (low + 0.05);
}
function standingOut(hex) {
  const ground = channels(css("--ground")), towards = luminance(ground) > 0.3 ? 0 : 255;
  let rgb = channels(hex);
  for (let k = 0; k < 40 && contrast(rgb, ground) < 3; k++) rgb = rgb.map(c => c + 0.05 * (towards - c));
  return "#" + rgb.map(c => Math.round(c).toString(16).padStart(2, "0")).join("");
}

const clock = t => t.toFixed(clamp(Math.ceil(2 - Math.log10(Math.max(last - first, 1e-9))), 1, 6));
const spacing = length => { const power = 10 ** Math.floor(Math.log10(length / 5)); return [1, 2, 5, 10].map(k => k * power).find(s => length / s <= 6); };

// What is read out: a row for each quantity of the member that is followed, else the names and depths of all.
const rows = part("read");
function element(kind, text, into) { const e = document.createElement(kind); if (text) e.textContent = text; return into.appendChild(e); }
let cells = [], cellsOf = null;
function build(member) {
  rows.replaceChildren(); cells = []; cellsOf = camera.follow;
  const head = element("b", "", rows), table = element("table", "", rows);
  cells.push(() => head.textContent = `t = ${clock(time.now)} s of ${clock(last)} s`);
  (member ? [member] : members.slice(0, 12)).forEach(m => {
    const row = element("tr", "", table), name = element("td", "", row), value = element("td", "", row);
    element("i", "", name).style.background = standingOut(m.colour);
    element("span", m.label, name);
    const shown = m.readings.filter((_, k) => member || members.length === 1 || k === 0).map(r => [r, r]);
    if (member || members.length === 1) shown.forEach(([r]) => {
      const line = element("tr", "", table); element("td", r.name, line);
      const cell = element("td", "", line); cells.push(() => cell.textContent = said(m, r));
    });
    else if (shown.length) cells.push(() => value.textContent = said(m, shown[0][0]));
  });
  if (!member && members.length > 12) element("div", `and ${members.length - 12} more`, rows);
  const note = element("div", "", rows);
  cells.push(() => note.textContent = view.note());
}
const digits = (x, count) => { const text = x.toFixed(count); return +text === 0 ? text.replace("-", "") : text; };  // no −0.0
const said = (m, r) => digits(r.wraps ? r.values[m.index + Math.round(m.part)] : between(r.values, m), r.digits) + " " + r.unit;
function read() {
  if (cellsOf !== camera.follow) build(members.length > 1 ? members[camera.follow] : members[0]);
  cells.forEach(write => write());
}

// Controls.
function choices(id, pairs, chosen, act) {
  const box = part(id);
  pairs.forEach(([text, value]) => box.add(new Option(text, value, value === chosen, value === chosen)));
  box.onchange = () => { act(+box.value); changed = true; };
  act(chosen);
}
const rates = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 1e4, 1e5], talls = [1, 2, 5, 10, 20, 50];
/** As fast as it was; but no run takes more than 30 s, and none less than 3 s. */
function opening(long) {
  if (long > 30) return rates.find(r => long / r <= 30) ?? rates.at(-1);
  return long < 3 ? rates.findLast(r => long / r >= 3) ?? rates[0] : 1;
}
choices("rate", rates.map(r => ["× " + r, r]), opening(last - first), v => time.rate = v);
choices("follow", [["all", -1], ...members.map((m, k) => [m.label, k])], given.follow, v => { camera.follow = v; camera.zoom = 1; });
choices("tall", talls.map(r => ["× " + r, r]), 1, v => camera.tall = v);
part("stretch").hidden = extent.deep > 0.3 * extent.wide || members.some(m => m.bodies.length > 1);
part("compass").toggleAttribute("hidden", !given.down);
document.title = given.title;
part("view").setAttribute("aria-label", given.title);
part("what").textContent = given.description;

function seek(t) { time.now = clamp(t, first, last); changed = true; }
function play(on) { time.playing = on; part("play").textContent = on ? "Pause" : "Play"; changed = true; }
const slider = part("time"), span = Math.max(last - first, 1e-9);
slider.oninput = () => seek(first + slider.value / 1000 * span);
part("play").onclick = () => play(!time.playing);
function turn(yaw, pitch) { camera.yaw += yaw; camera.pitch = clamp(camera.pitch + pitch, -1.5, 1.5); changed = true; }
function zoom(factor) { camera.zoom = clamp(camera.zoom * factor, 0.05, 200); changed = true; }
const sight = part("view"), fingers = new Map();
sight.onpointerdown = e => { sight.setPointerCapture(e.pointerId); fingers.set(e.pointerId, [e.clientX, e.clientY]); };
sight.onpointerup = sight.onpointercancel = e => fingers.delete(e.pointerId);
sight.onpointermove = e => {
  const before = fingers.get(e.pointerId), apart = () => { const [a, b] = [...fingers.values()]; return Math.hypot(a[0] - b[0], a[1] - b[1]) || 1; };
  if (!before) return;
  const was = fingers.size === 2 ? apart() : 0;
  fingers.set(e.pointerId, [e.clientX, e.clientY]);
  if (was) zoom(apart() / was); else turn((before[0] - e.clientX) / 150, (e.clientY - before[1]) / 150);
};
sight.addEventListener("wheel", e => { e.preventDefault(); zoom(Math.exp(-e.deltaY / 600)); }, { passive: false });
const step = () => Math.max(span / 500, 1e-3);
const anywhere = { " ": () => play(!time.playing), ",": () => seek(time.now - step()), ".": () => seek(time.now + step()), Home: () => seek(first), End: () => seek(last),
  a: () => { camera.frames = !camera.frames; changed = true; },
  f: () => { const box = part("follow"); box.selectedIndex = (box.selectedIndex + 1) % box.length; box.onchange(); } };
const inView = { ArrowLeft: () => turn(0.1, 0), ArrowRight: () => turn(-0.1, 0), ArrowUp: () => turn(0, 0.1), ArrowDown: () => turn(0, -0.1),
  "+": () => zoom(1.15), "=": () => zoom(1.15), "-": () => zoom(1 / 1.15) };
addEventListener("keydown", e => {
  if (e.ctrlKey || e.metaKey || e.altKey || (e.target !== sight && e.target !== document.body && !(e.target === slider && e.key === " "))) return;
  const act = anywhere[e.key.length === 1 ? e.key.toLowerCase() : e.key] || inView[e.key];
  if (act) { e.preventDefault(); act(); }
});

// A frame is drawn where something has changed; `spent` keeps the script's time of the last frames, ms.
const view = (typeof THREE !== "undefined" && solid()) || plan();
const spent = [];
let before = null;
function draw() {
  members.forEach(locate);
  view.draw();
  part("compass").style.transform = `rotate(${view.flat ? 0 : camera.yaw}rad)`;
  read();
  slider.value = 1000 * (time.now - first) / span;
  slider.setAttribute("aria-valuetext", `${clock(time.now)} seconds`);
}
function frame(stamp) {
  if (time.playing && before !== null) {
    time.now += time.rate * Math.min(stamp - before, 250) / 1000;
    if (time.now > last) time.now = first;
    changed = true;
  }
  before = stamp;
  if (changed) {
    const began = performance.now();
    changed = false; draw();
    spent.push(performance.now() - began); if (spent.length > 600) spent.shift();
  }
  requestAnimationFrame(frame);
}
new ResizeObserver(() => { view.resize(); changed = true; }).observe(sight);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { view.recolour(); cellsOf = null; changed = true; });
view.resize(); play(time.playing);
window.player = { seek, play, time, camera, members, spent, view, contrast, channels, redraw: () => { changed = true; } };
requestAnimationFrame(frame);
