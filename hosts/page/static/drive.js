// What the actuator gets, against the most that it may have.
import { figure, write } from "./draw.js";

/// The peak falls by half in this time.
const HALF_S = 0.15;
/// From here on the limit is near.
const NEAR = 0.85;

export class Drive {
  #box = document.getElementById("drive");
  #text = document.getElementById("drive-now");
  #most = null;
  #unit = "";
  #peak = 0;

  layout({ peak_drive: most }, scope) {
    this.#box.parentElement.hidden = !scope;
    [this.#most, this.#unit, this.#peak] = [most, scope?.unit ?? "", 0];
    this.#box.setAttribute("aria-valuemax", String(most ?? 1));
  }

  take(samples, rate) {
    if (!samples.length) return;
    let peak = this.#peak * 0.5 ** (samples.length / rate / HALF_S);
    for (const x of samples) peak = Math.max(peak, Math.abs(x));
    this.#peak = peak;
  }

  draw() {
    const part = this.#most ? Math.min(1, this.#peak / this.#most) : 0;
    this.#box.firstElementChild.style.transform = `scaleX(${part.toFixed(3)})`;
    this.#box.classList.toggle("near", part > NEAR);
  }

  show() {
    const of = this.#most ? ` of ${figure(this.#most)}` : "";
    const text = `${figure(this.#peak)}${of} ${this.#unit}`;
    write(this.#text, text);
    this.#box.setAttribute("aria-valuenow", this.#peak.toFixed(5));
    this.#box.setAttribute("aria-valuetext", text);
  }
}
