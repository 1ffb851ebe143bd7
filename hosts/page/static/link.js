// The WebSocket: passes messages on, and reconnects when it is lost.
const TOKEN = new URLSearchParams(location.search).get("token") ?? "";

/** The address of something that the run serves. */
export const address = (path, scheme = location.protocol) =>
  `${scheme}//${location.host}${path}?token=${encodeURIComponent(TOKEN)}`;

/// Between two measurements of the way to the run and back.
const ECHO_MS = 2000;

export class Link {
  onLayout() {}
  onView() {}
  onHand() {}
  onRefused() {}
  onState() {}

  /// Time of a message to the run and back in ms.
  there_and_back = NaN;

  #socket = null;
  #got = 0;
  #wait = 250;
  /// Why there is no connection. Later attempts do not change it.
  #why = "";
  #head = new TextDecoder();

  open() {
    this.onState("opening", this.#why || "Connecting to the run.");
    const socket = new WebSocket(address("/ws", location.protocol.replace("http", "ws")));
    socket.binaryType = "arraybuffer";
    this.#socket = socket;
    this.#got = 0;
    socket.onopen = () => {
      this.#wait = 250;
      this.#why = "";
      this.onState("open", "");
      this.#echo(socket);
    };
    socket.onmessage = ({ data }) => (typeof data === "string" ? this.#text(data) : this.#view(data));
    socket.onclose = (event) => this.#closed(event);
  }

  /** Sends numbers. False where there is no connection. */
  tell(numbers) {
    if (this.#socket?.readyState !== WebSocket.OPEN) return false;
    this.#socket.send(numbers);
    return true;
  }

  /** Sends a command: `{ name: [arguments] }`. docs/control.md lists them. */
  ask(what) {
    if (this.#socket?.readyState === WebSocket.OPEN) this.#socket.send(JSON.stringify(what));
    else this.onRefused("There is no connection to the run.");
  }

  #text(data) {
    const message = JSON.parse(data);
    if (message.layout) this.onLayout(...message.layout);
    else if (message.error) this.onRefused(`${message.error.slice(1).filter(Boolean).join(": ")}.`);
    else if (message.hand) this.onHand(...message.hand);
    else if (message.echo) this.there_and_back = performance.now() - message.echo[0];
  }

  #echo(socket) {
    if (socket.readyState !== WebSocket.OPEN) return;
    socket.send(JSON.stringify({ echo: [performance.now()] }));
    setTimeout(() => this.#echo(socket), ECHO_MS);
  }

  #view(data) {
    this.#got += 1;
    this.tell(new Float64Array([0, this.#got]));
    const length = new DataView(data).getUint32(0, true);
    const head = JSON.parse(this.#head.decode(new Uint8Array(data, 4, length)));
    this.onView(head.view, head.scopes, new Float32Array(data, Math.ceil((4 + length) / 4) * 4));
  }

  async #closed({ code, reason }) {
    if (code === 1001 && reason) this.#why = "The run has ended.";
    else if (code === 1008) this.#why = `The run let this page go: ${reason}.`;
    else this.#why ||= "The connection to the run is lost.";
    this.onState("lost", this.#why);
    try {
      const answer = await fetch(address("/places"));
      const { pages, most } = answer.ok ? await answer.json() : {};
      if (pages >= most) this.#why = `${most} pages watch this run already. This one waits for a place.`;
      if (answer.status === 403) this.#why = "This address is of another run. Open the one that the program printed.";
      this.onState("lost", this.#why);
    } catch {
      // No server: that is shown already.
    }
    setTimeout(() => this.open(), this.#wait);
    this.#wait = Math.min(this.#wait * 1.6, 4000);
  }
}
