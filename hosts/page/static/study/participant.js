// The participant's screen: one state at a time. All words come from the study, and no answer is kept.
import { make } from "./draw.js";
import { Link } from "./link.js";
import { Pointer } from "./pointer.js";
import { follow, press } from "./poll.js";
import "./awake.js";

const by = (id) => document.getElementById(id);
/// A second tap or a key held down does not press the next screen.
const SETTLE_MS = 300;
/// Keys of the left hand beside the digits 1 to 7.
const LETTERS = "qwertasdfgzxcvb";
/// Most characters of a text.
const MOST_CHARACTERS = 4000;

let screen = null;
let shown = "";
/// The questions, and the one that keys answer.
let asked = [];
let current = 0;
let sent = false;
/// The hand, where this page has a pad.
let hand = null;

function show(next) {
  const { chosen, ...rest } = next;
  const text = JSON.stringify(rest);
  // After a lost connection the same screen keeps its answers, and while another place is chosen.
  if (text !== shown) build(next, text);
  [...by("buttons").children].forEach((button, i) => button.setAttribute("aria-pressed", String(i === chosen)));
}

function build(next, text) {
  [screen, shown, sent, current] = [next, text, false, 0];
  const { state, sign, words } = next;
  document.documentElement.lang = words.language;
  const heading = state === "explore" && !sign ? "" : next.text;
  const numbered = ["wait", "reference", "explore"].includes(state) ? next.trial : "";
  say(by("text"), heading || numbered);
  say(by("trial"), heading ? numbered : "");
  by("text").classList.toggle("quiet", !heading);
  document.body.dataset.state = state;
  document.body.dataset.sign = !sign ? "" : state === "wait" ? "wait" : numbered ? "go" : "";
  stroke(next);
  by("feel").hidden = !next.buttons.length;
  by("choose").textContent = words.choose;
  by("buttons").replaceChildren(...next.buttons.map(place));
  asked = next.questions.map(question);
  by("questions").replaceChildren(...asked.map(({ box }) => box));
  say(by("refused"), "");
  by("go").hidden = ["wait", "paused", "end"].includes(state);
  by("go").children[0].textContent = words.next;
  by("go").children[1].textContent = words.space;
  by("fields").disabled = false;
  settle(next);
  scrollTo(0, 0);
  refocus();
}

function say(element, text) {
  element.textContent = text;
  element.hidden = !text;
}

/** Shows the pad while something is felt. */
function stroke({ pad, sides, state }) {
  const felt = pad && ["reference", "explore"].includes(state);
  by("pad").hidden = !felt;
  by("pad").classList.toggle("sides", sides);
  by("pad").setAttribute("aria-label", screen.words.pad);
  if (!pad) return;
  if (!hand) {
    const link = new Link();
    hand = new Pointer(link, by("pad"));
    hand.offer(true);
    link.onHand = (whose) => hand.held(whose);
    link.onState = (is) => hand.linked(is === "open");
    link.open();
  }
  hand.moved();
  if (!felt) hand.free();
}

/** A button that chooses a place to feel. */
function place(word, at) {
  const button = make("button", "", "");
  button.type = "button";
  if (at < 9) button.setAttribute("aria-keyshortcuts", String(at + 1));
  button.append(make("span", "", word));
  if (at < 9) button.append(cap(String(at + 1)));
  button.addEventListener("click", () => choose(at));
  return button;
}

async function choose(at) {
  if (sent || at >= screen.buttons.length) return;
  const of = screen;
  say(by("refused"), "");
  const why = await press({ press: "feel", token: screen.token, place: at });
  if (of === screen && why) say(by("refused"), why);
}

function settle(of) {
  by("go").disabled = true;
  setTimeout(() => {
    if (of === screen) by("go").disabled = false;
  }, SETTLE_MS);
}

function refocus() {
  if (asked[current]) asked[current].focus();
  else by("main").focus();
  point(current);
}

/** Marks the question that keys answer. */
function point(to) {
  current = to;
  asked.forEach(({ box }, i) => {
    box.classList.toggle("now", i === to && asked.length > 1);
    box.classList.toggle("next", i === to + 1);
  });
}

/** A question: its box, its answer or null, and the keys that it takes. */
function question(of, at) {
  const box = make("section", `question ${of.kind}`);
  const title = make("h2", "", of.text);
  title.id = `question-${at}`;
  box.setAttribute("aria-labelledby", title.id);
  const head = make("div", "head");
  head.append(title, cap("Tab", "tab"));
  box.append(head);
  const built = KINDS[of.kind](of, at);
  box.append(...built.parts);
  return { ...built, box };
}

function cap(text, name = "") {
  const key = make("kbd", name, text);
  key.setAttribute("aria-hidden", "true");
  return key;
}

/** Whether digits answer questions. Where places have buttons, digits choose these. */
const digits = () => !screen.buttons.length;

const KINDS = {
  scale({ from, to, low, high }, at) {
    let letters = 0;
    const numbers = Array.from({ length: to - from + 1 }, (_, i) => from + i);
    const options = numbers.map((n) => {
      const key = digits() && n >= 1 && n <= 7 ? String(n) : LETTERS[letters++] ?? "";
      const word = String(n).replace("-", "−");
      return { word, key: key === word ? "" : key, keys: [key, digits() ? String(n) : ""] };
    });
    const built = choice(options, at, (i) => from + i);
    built.parts[0].setAttribute("aria-describedby", `ends-${at}`);
    return { ...built, parts: [...built.parts, ends(low, high, at)] };
  },
  which(_, at) {
    const { places } = screen;
    const first = (word) => [...word.toLowerCase()][0];
    const options = places.map((word, i) => {
      const own = places.filter((other) => first(other) === first(word)).length === 1;
      const letter = own ? first(word) : "";
      const digit = digits() ? String(i + 1) : "";
      return { word, key: i < 7 && digit ? digit : letter, keys: [digit, letter] };
    });
    return choice(options, at, (i) => i);
  },
  same(_, at) {
    const { same, different } = screen.words;
    const key = (i) => (digits() ? String(i + 1) : LETTERS[i]);
    const options = [same, different].map((word, i) => ({ word, key: key(i), keys: [key(i)] }));
    return choice(options, at, (i) => i === 0);
  },
  sliders({ low, high }, at) {
    const all = screen.places.map((word, i) => slider(word, `${at}-${i}`));
    const group = make("div", "rows");
    group.append(...all.map(({ row }) => row));
    const missing = () => all.find(({ value }) => value() === null) ?? all[0];
    return {
      parts: [ends(low, high, at), group],
      given: () => (all.every(({ value }) => value() !== null) ? all.map(({ value }) => value()) : null),
      focus: () => missing().range.focus(),
      take: (key) => (all.find(({ range }) => range.matches(":focus")) ?? missing()).take(key),
      miss: () => {},
    };
  },
  text(_, at) {
    const area = make("textarea");
    Object.assign(area, { rows: 3, maxLength: MOST_CHARACTERS });
    area.setAttribute("aria-labelledby", `question-${at}`);
    const never = () => false;
    return { parts: [area], given: () => area.value, focus: () => area.focus(), take: never, miss: never };
  },
};

function ends(low, high, at) {
  const row = make("div", "ends");
  row.id = `ends-${at}`;
  row.append(make("span", "", low), make("span", "", high));
  return row;
}

/** Big buttons of which one is chosen. Two of them have the arrow keys left and right. */
function choice(options, at, value) {
  const row = make("div", "options");
  row.setAttribute("role", "radiogroup");
  row.setAttribute("aria-labelledby", `question-${at}`);
  row.setAttribute("aria-required", "true");
  row.style.setProperty("--count", String(Math.min(options.length, 11)));
  const two = options.length === 2;
  const inputs = options.map(({ word, key, keys }, i) => {
    const label = make("label", "option");
    const input = make("input");
    Object.assign(input, { type: "radio", name: `question-${at}` });
    if (keys[0]) input.setAttribute("aria-keyshortcuts", keys[0]);
    label.append(input, make("span", "", word));
    if (key) label.append(cap(two ? `${key} ${"←→"[i]}` : key));
    row.append(label);
    return input;
  });
  const chosen = () => inputs.findIndex((input) => input.checked);
  const choose = (i) => {
    inputs[i].checked = true;
    inputs[i].focus();
    row.removeAttribute("aria-invalid");
  };
  row.addEventListener("change", () => choose(chosen()));
  return {
    parts: [row],
    given: () => (chosen() < 0 ? null : value(chosen())),
    focus: () => inputs[Math.max(chosen(), 0)].focus(),
    miss: () => row.setAttribute("aria-invalid", "true"),
    take(key) {
      const step = { ArrowLeft: -1, ArrowUp: -1, ArrowRight: 1, ArrowDown: 1 }[key];
      const last = inputs.length - 1;
      // The first step of a longer row chooses its first or last.
      const from = two ? 0.5 : chosen() >= 0 ? chosen() : step > 0 ? -1 : last + 1;
      const to = step
        ? Math.min(Math.max(two ? from + step / 2 : from + step, 0), last)
        : options.findIndex(({ keys }) => keys.includes(key));
      if (to < 0) return false;
      choose(to);
      return true;
    },
  };
}

/** A number from 0 to 100. It has no value until somebody moves it. */
function slider(word, id) {
  const row = make("div", "slider");
  const label = make("label", "", word);
  const range = make("input");
  const now = make("output", "", "–");
  Object.assign(range, { type: "range", min: 0, max: 100, step: 1, value: 50, id: `slider-${id}` });
  range.setAttribute("aria-valuetext", "–");
  range.setAttribute("aria-keyshortcuts", "a d q e");
  label.htmlFor = range.id;
  let value = null;
  const set = (to) => {
    value = Math.min(Math.max(to, 0), 100);
    range.value = String(value);
    range.setAttribute("aria-valuetext", String(value));
    now.textContent = String(value);
    row.classList.add("set");
  };
  const steps = { a: -1, d: 1, q: -10, e: 10 };
  const step = (letters, sign) => {
    const button = make("button", "step");
    button.type = "button";
    button.tabIndex = -1;
    // Arrow keys do the same where a page is read aloud.
    button.setAttribute("aria-hidden", "true");
    button.append(make("span", "", sign), cap(letters));
    button.addEventListener("click", () => set(Number(range.value) + steps[letters[0]]));
    return button;
  };
  range.addEventListener("input", () => set(Number(range.value)));
  // A press on the middle chooses it too.
  range.addEventListener("pointerup", () => set(Number(range.value)));
  row.append(label, step("a q", "−"), range, step("d e", "+"), now);
  return {
    row,
    range,
    value: () => value,
    take(key) {
      if (!(key in steps)) return false;
      range.focus();
      set(Number(range.value) + steps[key]);
      return true;
    },
  };
}

/** The letter or digit of a key: digits by their place, letters as on the keyboard. */
function named({ key, code }) {
  if (/^Digit\d$/.test(code)) return code.slice(5);
  return key.length === 1 ? key.toLowerCase() : key;
}

function go() {
  if (sent || by("go").hidden || by("go").disabled) return;
  const open = asked.findIndex((one) => one.given() === null);
  if (open >= 0) {
    asked[open].miss();
    asked[open].focus();
    return;
  }
  const { token } = screen;
  const answers = asked.map((one) => one.given());
  send(asked.length ? { press: "answer", token, answers } : { press: "next", token });
}

async function send(what) {
  const of = screen;
  sent = true;
  by("fields").disabled = true;
  say(by("refused"), "");
  const why = await press(what);
  // The next screen may have come before the verdict.
  if (of !== screen || why === "") return;
  sent = false;
  by("fields").disabled = false;
  refocus();
  if (why === null) there(false);
  else say(by("refused"), why);
}

function there(is) {
  // After the end nobody misses the server.
  const fine = is || screen?.state === "end";
  if (fine !== by("lost").hidden) say(by("lost"), fine ? "" : screen?.words.lost ?? "…");
}

by("form").addEventListener("submit", (event) => {
  event.preventDefault();
  go();
});
addEventListener("focusin", ({ target }) => {
  const at = asked.findIndex(({ box }) => box.contains(target));
  if (at >= 0) point(at);
});
addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || event.isComposing || event.defaultPrevented) return;
  if (event.target.matches?.("textarea")) return;
  if (event.key === "Enter" || event.code === "Space") {
    event.preventDefault();
    if (!event.repeat) go();
    return;
  }
  const key = named(event);
  if (screen && !digits() && /^[1-9]$/.test(key)) {
    event.preventDefault();
    if (!event.repeat) choose(Number(key) - 1);
    return;
  }
  const letter = /^Key[A-Z]$/.test(event.code) ? event.code.slice(3).toLowerCase() : "";
  const takes = (key) => !sent && key && asked[current]?.take(key);
  // Other alphabets have the letters at their places.
  if (takes(key) || (!/^[a-z]$/.test(key) && takes(letter))) event.preventDefault();
});
// Firefox presses a button when space is released, even if its press was handled.
addEventListener("keyup", (event) => {
  if (event.code === "Space" && !event.target.matches?.("textarea")) event.preventDefault();
});

follow(show, there);
