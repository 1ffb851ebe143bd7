// The page: one link to the run, parts that show it, and one animation frame for all.
import { Link } from "./link.js";
import { Hand } from "./hand.js";
import { Gallery } from "./gallery.js";
import { Setting } from "./setting.js";
import { Listen } from "./listen.js";
import { Record } from "./record.js";
import { Drive } from "./drive.js";
import { Graph } from "./graph.js";
import { Scopes } from "./scope.js";
import { Spectrum } from "./spectrum.js";
import { Timing } from "./timing.js";
import { Health } from "./health.js";
import { Controls } from "./controls.js";
import { SceneMap } from "./map.js";
import { Strokes } from "./strokes.js";
import "./awake.js";
import { tabs } from "./tabs.js";
import { make, write } from "./draw.js";

const by = (id) => document.getElementById(id);
const WORDS = {
  starting: "starting",
  playing: "playing",
  muted: "muted",
  lost: "device lost",
  stopping: "stopping",
  failed: "failed",
};

const link = new Link();
const hand = new Hand(link);
const setting = new Setting(link);
/// What a person asks for by hand belongs to the setting.
const byHand = {
  ask(what) {
    setting.touched();
    link.ask(what);
  },
};
const gallery = new Gallery(byHand);
const listen = new Listen(link);
const record = new Record();
const drive = new Drive();
const graph = new Graph(by("graph"), by("graph-note"));
const scopes = new Scopes(by("scopes"), by("span"));
const spectrum = new Spectrum(by("spectrum"), by("spectrum-key"), scopes);
const timing = new Timing(by("timing"), by("times"), by("deadline"));
const health = new Health(by("tallies"), by("latency"), by("sources"));
const controls = new Controls(by("controls"), byHand);

const map = new SceneMap(by("map"), hand);
const strokes = new Strokes(by("strokes"), hand);

let layout = null;
let view = null;
let fresh = false;
let muted = false;
let scoped = false;
let away = false;
let noticeEnds = 0;

function say(text, forMs = 0) {
  const notice = by("notice");
  notice.textContent = text;
  notice.hidden = text === "";
  noticeEnds = forMs ? performance.now() + forMs : 0;
}

const told = new Map();
function facts(pairs) {
  for (const [name, value] of pairs) {
    if (!told.has(name)) {
      const pair = make("div");
      const text = make("dd");
      pair.append(make("dt", "", name), text);
      by("facts").append(pair);
      told.set(name, { pair, text });
    }
    const { pair, text } = told.get(name);
    if (pair.hidden !== !value) pair.hidden = !value;
    if (value) write(text, value);
  }
}

function clock(seconds) {
  const s = Math.max(0, seconds ?? 0);
  const two = (x) => String(Math.floor(x)).padStart(2, "0");
  return `${Math.floor(s / 3600)}:${two((s / 60) % 60)}:${two(s % 60)}`;
}

function condition(is, word) {
  const box = by("condition");
  if (box.dataset.is !== is) {
    box.dataset.is = is;
    box.textContent = word;
  }
}

function showMute(now) {
  if (now === muted) return;
  muted = now;
  const button = by("mute");
  button.setAttribute("aria-pressed", String(now));
  by("mute-word").textContent = now ? "Muted" : "Mute";
}

function mute() {
  link.ask({ mute: [!muted] });
}

/** A unit in typography; a plain number has none. */
const written = (unit) => (unit === "1" ? "" : unit.replace("^2", "²"));

function tidy(layout) {
  for (const node of layout.nodes) node.outputs = node.outputs.map(([name, unit]) => [name, written(unit)]);
  for (const scope of layout.scopes) scope.unit = written(scope.unit);
}

link.onLayout = (next, withHand, maps) => {
  tidy(next);
  const same = layout && layout.number === next.number && layout.file === next.file
    && layout.nodes.length === next.nodes.length;
  layout = next;
  const name = next.file.split(/[\\/]/).pop();
  by("file").textContent = name;
  by("file").title = next.file;
  document.title = name ? `${name} · Asperity` : "Asperity";
  hand.offer(withHand);
  map.layout(next, maps);
  strokes.offer(withHand);
  controls.layout(next, same);
  setting.layout(next);
  gallery.layout(next);
  if (!same) {
    graph.layout(next);
    scopes.layout(next);
    listen.restart();
    drive.layout(next, next.scopes.find(({ name }) => DRIVES.includes(name)));
  }
};
link.onView = (next, places, samples) => {
  const anew = view && next.number < view.number;
  if (anew) scopes.restart();
  if (away && layout) {
    away = false;
    setting.found(anew);
    if (anew && muted && !next.muted) link.ask({ mute: [true] });
  }
  view = next;
  fresh = true;
  scopes.take(places, samples);
  if (layout && view.layout === layout.number) hear(places, samples);
};

/// Scopes of what the actuator gets.
const DRIVES = ["current", "voltage"];

/** Gives the new samples of the signals to those who want them. */
function hear(places, samples) {
  const of = {};
  let from = 0;
  layout.scopes.forEach(({ name, rate_hz: rate }, i) => {
    const [first, count] = places[i] ?? [0, 0];
    of[name] = { first, rate, new: samples.subarray(from, from + count) };
    from += count;
  });
  const { speed, force, acceleration } = of;
  if (acceleration) {
    listen.take(acceleration.first, acceleration.new, acceleration.rate, view.seconds);
    record.take(acceleration.first, acceleration.new, acceleration.rate);
    if (speed) setting.take(view.strength, speed.new, force?.new ?? [], acceleration.new, acceleration.rate);
  }
  const driven = of[DRIVES.find((name) => name in of)];
  if (driven) drive.take(driven.new, driven.rate);
}

gallery.onShown = (name, image, mm) => {
  hand.lay(image, mm);
  record.of(name);
};
link.onHand = (whose) => hand.held(whose);
link.onRefused = (why) => {
  say(why, 4000);
  controls.refused();
  gallery.refused();
};
link.onState = (state, why) => {
  document.body.dataset.link = state;
  if (state === "open") say("");
  else {
    if (view) {
      away = true;
      setting.lost();
    }
    condition("away", "no connection");
    say(why);
  }
  hand.linked(state === "open");
};

/// Texts change ten times a second, so that they can be read. Each part writes in a frame of its own.
const TEXT_MS = 100;
const TEXTS = [
  () => setting.show(),
  () => {
    listen.show();
    record.show();
    drive.show();
  },
  () => scoped && facts([
    ["device", view.device],
    ["clock", view.clock && view.period_frames ? `${view.clock}, ${view.period_frames} frames` : view.clock],
    ["rate", `${layout.tick_hz} Hz, ${layout.audio_hz / 1000} kHz`],
    ["time", clock(view.seconds)],
  ]),
  () => scoped && view.layout === layout.number && graph.show(view),
  () => scoped && timing.show(view.timing, view.ticks),
  () => scoped && health.show(view),
  () => map.show(view),
];
let texted = 0;
let turn = 0;
function frame(now) {
  requestAnimationFrame(frame);
  if (noticeEnds && now > noticeEnds) say("");
  hand.draw();
  map.draw(view);
  if (!fresh || !layout || !view) return;
  fresh = false;
  if (scoped) {
    scopes.draw();
    spectrum.draw(now);
  } else drive.draw();
  if (document.body.dataset.link === "open") condition(view.condition, WORDS[view.condition] ?? view.condition);
  showMute(view.muted);
  if (now - texted < TEXT_MS / TEXTS.length) return;
  texted = now;
  TEXTS[turn]();
  turn = (turn + 1) % TEXTS.length;
}

by("mute").addEventListener("click", mute);
addEventListener("keydown", (event) => {
  const typing = event.target.closest?.("input:not([type=range]), select, textarea");
  if (event.code !== "Space" || event.repeat || typing || event.ctrlKey || event.metaKey || event.altKey) return;
  if (event.target.closest?.("button, summary, [type=checkbox]") && event.target.id !== "mute") return;
  event.preventDefault();
  mute();
});
// Firefox presses a button when space is released, even if its press was handled.
by("mute").addEventListener("keyup", (event) => {
  if (event.code === "Space") event.preventDefault();
});

let sure = 0;
by("stop").addEventListener("click", (event) => {
  const button = event.currentTarget;
  if (performance.now() < sure) link.ask({ stop: [] });
  sure = performance.now() + 3000;
  button.textContent = "Stop the run?";
  setTimeout(() => {
    if (performance.now() >= sure - 50) button.textContent = "Stop";
  }, 3000);
});

tabs(document.querySelector("[role=tablist]"), (shown) => {
  scoped = shown === "scope";
  fresh = true;
});
link.open();
requestAnimationFrame(frame);

export { listen, record, scopes, setting };
