// Asks for states, and sends presses. A server that is lost is asked again.
const TOKEN = new URLSearchParams(location.search).get("token") ?? "";
/// Longest wait for an answer. The server holds a request for 5 s.
const PATIENCE_MS = 9000;
/// Shortest and longest wait before a lost server is asked again.
const AGAIN_MS = [250, 4000];

const wait = (ms) => new Promise((done) => setTimeout(done, ms));

function ask(path, query = "", options = {}) {
  const address = `${path}?token=${encodeURIComponent(TOKEN)}${query}`;
  return fetch(address, { signal: AbortSignal.timeout(PATIENCE_MS), ...options });
}

/** The state after this one, or null where there is no server. */
async function after(seen) {
  try {
    const answer = await ask("/state", `&seen=${seen}`);
    return answer.ok ? await answer.json() : null;
  } catch {
    return null;
  }
}

/** Shows each state up to the end, and says whether there is a server. Rests between two states. */
export async function follow(show, there, restMs = 0) {
  let [seen, again] = [0, AGAIN_MS[0]];
  for (;;) {
    const state = await after(seen);
    there(state !== null);
    if (state) {
      if (state.screen && state.number !== seen) show(state.screen);
      if (state.screen?.state === "end") return;
      [seen, again] = [state.number, AGAIN_MS[0]];
      if (restMs) await wait(restMs);
    } else {
      // Another server counts anew.
      seen = 0;
      await wait(again);
      again = Math.min(again * 1.6, AGAIN_MS[1]);
    }
  }
}

/** Sends a press. Answers "" where it counts, why it does not, or null where there is no server. */
export async function press(what) {
  try {
    const answer = await ask("/press", "", { method: "POST", body: JSON.stringify(what) });
    if (answer.status === 409) return await answer.text();
    return answer.ok ? "" : null;
  } catch {
    return null;
  }
}
