// The materials of the graph as cards with pictures: families, search, favourites. A click or a key chooses one.
import { address } from "./link.js";
import { make } from "./draw.js";

const FAVOURITES = "asperity.favourites";
const ALL = "all";
const STARRED = "\u2605 favourites";
/// Letters typed within this time are one word.
const TYPING_MS = 700;

/** Where the picture of a material is. */
const picture = (node, name) => address(`/picture/${encodeURIComponent(node)}/${encodeURIComponent(name)}`);

export class Gallery {
  /** Called with the material that lies on the surface, its picture (an image or null) and its width in mm. */
  onShown() {}

  #link;
  #box = document.getElementById("cards");
  #search = document.getElementById("search");
  #families = document.getElementById("families");
  #which = document.getElementById("texture");
  #star = document.getElementById("favourite");
  #favourites = new Set(JSON.parse(localStorage.getItem(FAVOURITES) ?? "[]"));
  /// The layout's nodes with materials, and everything about these materials by node.
  #nodes = [];
  #all = {};
  #node = "";
  #chosen = "";
  #family = ALL;
  #cards = [];
  #typed = { text: "", at: 0 };
  #shown = "";

  constructor(link) {
    this.#link = link;
    this.#search.addEventListener("input", () => this.#filter());
    this.#search.addEventListener("keydown", (event) => this.#down(event));
    this.#which.addEventListener("change", () => this.#of(this.#which.value));
    this.#box.addEventListener("click", (event) => this.#click(event));
    this.#box.addEventListener("keydown", (event) => this.#key(event));
    this.#star.addEventListener("click", () => this.#favour(this.#chosen));
  }

  async layout({ materials }) {
    document.querySelector(".gallery").hidden = !materials.length;
    const names = (nodes) => JSON.stringify(nodes.map(({ node, names }) => [node, names]));
    const same = names(materials) === names(this.#nodes);
    this.#nodes = materials;
    if (!same) {
      const answer = await fetch(address("/materials"));
      if (answer.ok) this.#all = await answer.json();
      this.#which.replaceChildren(...materials.map(({ node }) => new Option(node, node)));
      this.#which.parentElement.hidden = materials.length < 2;
      this.#of(materials[0]?.node ?? "");
    } else this.#choose(this.#nodes.find(({ node }) => node === this.#node)?.chosen ?? "");
  }

  /** Shows what is chosen in truth, after a request was refused. */
  refused() {
    this.#choose(this.#nodes.find(({ node }) => node === this.#node)?.chosen ?? "");
  }

  /** Shows the materials of a texture node. */
  #of(node) {
    this.#node = node;
    const all = this.#all[node] ?? [];
    const families = [...new Set(all.map(({ family }) => family).filter(Boolean))].sort();
    if (![ALL, STARRED, ...families].includes(this.#family)) this.#family = ALL;
    this.#families.replaceChildren(...[ALL, STARRED, ...families].map((family) => this.#chip(family)));
    this.#cards = all.map((material) => this.#card(material));
    this.#box.replaceChildren(...this.#cards.map(({ item }) => item));
    this.#filter();
    this.#choose(this.#nodes.find((one) => one.node === node)?.chosen ?? "");
  }

  #chip(family) {
    const chip = make("button", "", family);
    chip.type = "button";
    chip.setAttribute("aria-pressed", String(family === this.#family));
    chip.addEventListener("click", () => {
      this.#family = family;
      for (const one of this.#families.children) one.setAttribute("aria-pressed", String(one === chip));
      this.#filter();
    });
    return chip;
  }

  #card(material) {
    const { name, pictured } = material;
    const item = make("li");
    const button = make("button", "card");
    button.type = "button";
    button.tabIndex = -1;
    button.title = material.description;
    const image = make(pictured ? "img" : "div", pictured ? "" : "blank");
    if (pictured) Object.assign(image, { src: picture(this.#node, name), alt: "", loading: "lazy", draggable: false });
    button.append(image, make("span", "", name));
    const star = make("button", "star");
    star.type = "button";
    star.tabIndex = -1;
    item.append(button, star);
    const text = `${name} ${material.family} ${material.description}`.toLowerCase();
    const card = { material, item, button, star, text };
    this.#starred(card);
    return card;
  }

  #starred({ material: { name }, star }) {
    star.setAttribute("aria-label", `Favourite: ${name}`);
    star.setAttribute("aria-pressed", String(this.#favourites.has(name)));
  }

  #filter() {
    const words = this.#search.value.toLowerCase().split(/\s+/).filter(Boolean);
    let found = 0;
    for (const { material, item, text } of this.#cards) {
      const kin = this.#family === ALL || material.family === this.#family
        || (this.#family === STARRED && this.#favourites.has(material.name));
      item.hidden = !(kin && words.every((word) => text.includes(word)));
      found += !item.hidden;
    }
    const none = this.#family === STARRED && !words.length ? "none yet: mark one with its star" : "none found";
    document.getElementById("found").textContent = found ? `${found} of ${this.#cards.length}` : none;
    this.#rove();
  }

  /** One card can be reached by the tab key: the chosen one, or the first. */
  #rove(to) {
    const seen = this.#cards.filter(({ item }) => !item.hidden);
    const at = to ?? seen.find(({ material }) => material.name === this.#chosen) ?? seen[0];
    for (const card of this.#cards) card.button.tabIndex = card === at ? 0 : -1;
  }

  /** Marks a card as chosen, and lays its picture on the surface. */
  #choose(name) {
    this.#chosen = name;
    const card = this.#cards.find(({ material }) => material.name === name);
    for (const one of this.#cards) one.button.setAttribute("aria-pressed", String(one === card));
    this.#rove();
    const key = `${this.#node}\n${name}`;
    this.#star.hidden = !card;
    this.#star.setAttribute("aria-pressed", String(this.#favourites.has(name)));
    this.#star.setAttribute("aria-label", `Favourite: ${name}`);
    if (key === this.#shown) return;
    this.#shown = key;
    const material = card?.material;
    document.getElementById("chosen").textContent = name || "\u2013";
    document.getElementById("about").textContent = material
      ? [material.family, material.description].filter(Boolean).join(". ") : "";
    if (card) this.#reveal(card.item);
    if (!material?.pictured) return this.onShown(name, null, 0);
    const image = new Image();
    image.onload = () => key === this.#shown && this.onShown(name, image, material.picture_mm ?? 0);
    image.onerror = () => key === this.#shown && this.onShown(name, null, 0);
    image.src = picture(this.#node, name);
  }

  /** Scrolls the list, and never the page. */
  #reveal(item) {
    const [box, at] = [this.#box.getBoundingClientRect(), item.getBoundingClientRect()];
    if (at.top < box.top || at.bottom > box.bottom) this.#box.scrollTop += at.top - box.top - (box.height - at.height) / 2;
    if (at.left < box.left || at.right > box.right) this.#box.scrollLeft += at.left - box.left - (box.width - at.width) / 2;
  }

  #click(event) {
    const card = this.#cards.find(({ item }) => item.contains(event.target));
    if (!card) return;
    if (event.target === card.star) return this.#favour(card.material.name);
    this.#ask(card.material.name);
    // After a click with the mouse the keys are for the surface again.
    if (event.detail) document.getElementById("surface").focus({ preventScroll: true });
  }

  #ask(name) {
    if (name === this.#chosen) return;
    this.#choose(name);
    this.#link.ask({ material: [name, this.#node] });
  }

  #favour(name) {
    if (!this.#favourites.delete(name)) this.#favourites.add(name);
    localStorage.setItem(FAVOURITES, JSON.stringify([...this.#favourites]));
    this.#cards.forEach((card) => this.#starred(card));
    this.#star.setAttribute("aria-pressed", String(this.#favourites.has(this.#chosen)));
    if (this.#family === STARRED) this.#filter();
  }

  /** From the search to the first card. Enter chooses it. */
  #down(event) {
    const first = this.#cards.find(({ item }) => !item.hidden);
    if (!first || !["ArrowDown", "Enter"].includes(event.key)) return;
    event.preventDefault();
    if (event.key === "Enter") this.#ask(first.material.name);
    else this.#go(first);
  }

  #go(card) {
    this.#rove(card);
    card.button.focus();
  }

  #key(event) {
    const seen = this.#cards.filter(({ item }) => !item.hidden);
    const at = seen.findIndex(({ item }) => item.contains(event.target));
    if (at < 0 || event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key === "*") {
      this.#favour(seen[at].material.name);
    } else if (event.key.length === 1 && event.key !== " ") {
      this.#type(event.key.toLowerCase(), seen, at);
    } else {
      const to = this.#beside(event.key, seen, at);
      if (to === undefined) return;
      if (seen[to]) this.#go(seen[to]);
    }
    event.preventDefault();
  }

  /** The card that an arrow leads to: cards stand in rows, or on a phone in columns. */
  #beside(key, seen, at) {
    const [{ offsetTop: top, offsetLeft: left }, next] = [seen[0].item, seen[1]?.item];
    const rows = !next || next.offsetTop === top;
    const each = Math.max(1, seen.filter(({ item }) => (rows ? item.offsetTop === top : item.offsetLeft === left)).length);
    const [across, down] = rows ? [1, each] : [each, 1];
    return {
      ArrowLeft: at - across, ArrowRight: at + across, ArrowUp: at - down, ArrowDown: at + down, Home: 0, End: seen.length - 1,
    }[key];
  }

  /** Goes to the next card whose name begins with what was typed. */
  #type(letter, seen, at) {
    const now = performance.now();
    const text = now - this.#typed.at < TYPING_MS ? this.#typed.text + letter : letter;
    this.#typed = { text, at: now };
    const from = text.length > 1 ? at : at + 1;
    const turned = [...seen.slice(from), ...seen.slice(0, from)];
    const found = turned.find(({ material }) => material.name.toLowerCase().startsWith(text));
    if (found) this.#go(found);
  }
}
