// The experimenter's screen: what to mount, where the session stands, and what is felt now.
import { count, figure, make, write } from "./draw.js";
import { follow, press } from "./poll.js";
import "./awake.js";

const by = (id) => document.getElementById(id);
/// Rest between two states: figures change about ten times a second.
const REST_MS = 100;
/// From this drive on the limit is near.
const NEAR = 0.85;

/// What the participant does in each state.
const DOES = {
  welcome: "The participant reads the welcome.",
  instructions: "The participant reads the instructions.",
  break: "The participant takes a break.",
  reference: "The participant feels the reference.",
  explore: "The participant explores and answers.",
  survey: "The participant answers the survey.",
  end: "The session is over.",
};
/// States with a trial that can be left out.
const TRIAL = ["wait", "reference", "exchange", "explore"];
/// What the experimenter does before the participant goes on.
const DO = {
  wait: "Mount the samples of this trial. Then press Ready.",
  none: "Take all samples away. Then press Ready.",
  exchange: "Take the sample of the reference away. Then press Ready.",
};

let screen = null;
let problem = "";

function show(next) {
  screen = next;
  const { state, is_paused: paused, live } = next;
  const waits = state in DO && !paused;
  document.title = `Experimenter · ${next.title}`;
  write(by("title"), next.title);
  const mounts = waits ? DO[next.mount.length || state !== "wait" ? state : "none"] : DOES[state] ?? state;
  write(by("waits"), paused ? "Paused. The participant waits for you." : mounts);
  by("waits").dataset.for = next.waits_for;
  write(by("pause").children[0], paused ? "Resume" : "Pause");
  by("pause").disabled = state === "end";
  by("ready").disabled = !waits;
  by("mark").querySelector("button").disabled = !TRIAL.includes(state);
  by("note").querySelector("button").disabled = false;
  showMounts(next, waits);
  rows(by("session"), session(next));
  by("live").hidden = !live;
  by("mute").hidden = typeof live?.muted !== "boolean";
  by("mute").setAttribute("aria-pressed", String(live?.muted === true));
  write(by("mute").children[0], live?.muted ? "Muted" : "Mute");
  if (live) showLive(live);
  // An alert is told once, not with every state.
  if ((live?.problem ?? "") !== problem) say(by("problem"), (problem = live?.problem ?? ""));
}

function showMounts({ mount, part, state }, waits) {
  by("mount").hidden = part === null;
  by("mount").dataset.now = String(waits);
  const mounted = state === "explore" || state === "reference";
  write(by("mount-title"), waits ? "Mount now" : mounted ? "Mounted" : "Mount next");
  const wanted = JSON.stringify(mount);
  if (by("mounts").dataset.shown === wanted) return;
  by("mounts").dataset.shown = wanted;
  const items = mount.map(([place, name]) => {
    const item = make("li", "", "");
    item.append(make("span", "", place), name);
    return item;
  });
  by("mounts").replaceChildren(...(items.length ? items : [make("li", "none", "No sample in this trial.")]));
}

function session(next) {
  const trial = next.part === null ? "" : `${next.number} of ${next.count}`;
  return [
    ["Part", next.part],
    ["Trial", trial],
    ["Trials left in all", count(next.left)],
    ...next.levels,
    ["Reference", next.reference],
    ...next.shown.map((name, i) => [next.places[i], name]),
    ["Chosen", next.chosen],
    ["Varied to", next.level === null ? "" : figure(next.level)],
  ];
}

function showLive(live) {
  const has = (x) => typeof x === "number";
  const place = live.position_mm?.map((x) => x.toFixed(1).replace("-", "−")).join(", ");
  rows(by("figures"), [
    ["Device", live.device],
    ["Position", place && `${place} mm`],
    ["Force", has(live.force_n) && `${figure(live.force_n)} N`],
    ["Speed", has(live.speed_mm_s) && `${figure(live.speed_mm_s)} mm/s`],
    ["Deadline misses", has(live.misses) && count(live.misses), live.misses > 0],
    ["Faults", has(live.faults) && count(live.faults), live.faults > 0],
    ["Drive", has(live.drive) && `${Math.round(100 * live.drive)} % of the limit`],
  ]);
  by("drive").hidden = !has(live.drive);
  const drive = Math.min(Math.max(live.drive ?? 0, 0), 1);
  by("drive").classList.toggle("near", drive > NEAR);
  by("drive").setAttribute("aria-valuenow", drive.toFixed(2));
  by("drive").firstElementChild.style.transform = `scaleX(${drive.toFixed(3)})`;
}

/** Writes rows of a name and a text into a list. Rows without a text are left out. */
function rows(list, all) {
  const kept = all.filter(([, text]) => text);
  while (list.children.length > 2 * kept.length) list.lastElementChild.remove();
  while (list.children.length < 2 * kept.length) list.append(make("dt"), make("dd"));
  kept.forEach(([name, text, bad], i) => {
    write(list.children[2 * i], name);
    write(list.children[2 * i + 1], text);
    list.children[2 * i + 1].classList.toggle("bad", bad === true);
  });
}

function say(element, text) {
  element.textContent = text;
  element.hidden = !text;
}

/** Sends a press, and says whether it counts. */
async function send(what, done = "") {
  say(by("refused"), "");
  write(by("done"), "");
  const why = await press(what);
  if (why === null) say(by("refused"), "The program did not take this. Try again.");
  else if (why) say(by("refused"), why);
  else write(by("done"), done);
  return why === "";
}

const ACTIONS = {
  r: () => !by("ready").disabled && send({ press: "ready", token: screen.token }),
  p: () => !by("pause").disabled && send({ press: screen.is_paused ? "resume" : "pause" }),
  m: () => !by("mute").hidden && send({ press: screen.live.muted ? "unmute" : "mute" }),
};
by("ready").addEventListener("click", ACTIONS.r);
by("pause").addEventListener("click", ACTIONS.p);
by("mute").addEventListener("click", ACTIONS.m);
addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || event.repeat) return;
  if (!event.target.matches?.("input")) ACTIONS[event.key.toLowerCase()]?.();
});

/** A form of one text. It is cleared once the text is taken. */
function form(id, input, what, done) {
  by(id).addEventListener("submit", async (event) => {
    event.preventDefault();
    const text = by(input).value.trim();
    if (text && (await send(what(text), done))) by(input).value = "";
  });
}
form("mark", "why", (why) => ({ press: "mark", token: screen.token, why }), "The trial is left out.");
form("note", "remark", (text) => ({ press: "note", text }), "The note is in the log.");

follow(show, (is) => (by("lost").hidden = is), REST_MS);
