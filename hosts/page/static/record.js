// Records the acceleration that is played, and offers it as a WAV file: a sample of 1 is 1 m/s².
import { wav } from "./wav.js";

/// Longest recording.
const MOST_S = 300;

export class Record {
  #button = document.getElementById("record");
  #link = document.getElementById("take");
  #text = document.getElementById("taken");
  #on = false;
  #chunks = [];
  #count = 0;
  #lost = 0;
  #next = null;
  #rate = 0;
  #name = "";
  #url = "";
  /// The last recording: a WAV file.
  file = null;

  constructor() {
    this.#button.addEventListener("click", () => (this.#on ? this.#end() : this.#begin()));
  }

  /** The material that is played, for the name of the file. */
  of(name) {
    this.#name = name;
  }

  #begin() {
    this.#on = true;
    [this.#chunks, this.#count, this.#lost, this.#next] = [[], 0, 0, null];
    this.#link.hidden = true;
    this.#show();
  }

  /** New samples of the acceleration; `first` counts them since the layout. */
  take(first, samples, rate) {
    if (!this.#on || !samples.length) return;
    if (this.#rate !== rate && this.#count) return this.#end();
    this.#rate = rate;
    // Samples that did not arrive are zeros, so that the time stays true.
    const gap = this.#next !== null && first > this.#next ? Math.min(first - this.#next, rate) : 0;
    if (gap) this.#chunks.push(new Float32Array(gap));
    this.#lost += gap;
    this.#chunks.push(samples.slice());
    this.#count += gap + samples.length;
    this.#next = first + samples.length;
    if (this.#count >= MOST_S * rate) this.#end();
  }

  /** Writes how long it is so far. */
  show() {
    if (this.#on) this.#show();
  }

  #end() {
    this.#on = false;
    URL.revokeObjectURL(this.#url);
    if (this.#count) {
      this.file = wav(this.#chunks, this.#rate);
      this.#url = URL.createObjectURL(this.file);
      this.#link.href = this.#url;
      this.#link.download = `asperity ${this.#name}.wav`.replace(/[^\w .-]/g, "");
      this.#link.textContent = "Save the WAV file";
    }
    this.#link.hidden = !this.#count;
    this.#chunks = [];
    this.#show();
  }

  #show() {
    this.#button.setAttribute("aria-pressed", String(this.#on));
    const lost = this.#lost ? `, ${this.#lost} samples lost on the way` : "";
    const text = this.#count
      ? `${(this.#count / this.#rate).toFixed(1)} s of acceleration, ${this.#rate} Hz, 1.0 is 1 m/s²${lost}.` : "";
    const state = this.#on ? "Stop" : "Record";
    if (this.#button.textContent !== state) this.#button.textContent = state;
    if (this.#text.textContent !== text) this.#text.textContent = text;
  }
}
