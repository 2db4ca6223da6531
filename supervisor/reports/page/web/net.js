// Connection to the server: shows the token, passes messages on, sends orders, and reports a lost
// server.

// Silence after which the server is lost. It sends something every 300 ms.
const LOST_AFTER_MS = 900;
const AGAIN_AFTER_MS = 500;
// A new attempt after these codes would fail again, so the notice stays.
const FINAL = {
  4401: "the token of this page is missing, wrong or expired: open an address that `firsthand page` printed at its start, or one from the file that it named",
  4409: "another browser replaced this page; reload it to connect again",
};

/// Returns the token of the address's fragment. The tab stores it, and the address bar hides it.
function token() {
  const shown = location.hash.slice(1);
  if (shown) history.replaceState({ token: shown }, "", location.pathname);
  return shown || history.state?.token || "";
}

const isStop = ({ order }) => order === "stop";

export class Net {
  /// `on` has `message`, `blob`, `role` and `lost`.
  constructor(on) {
    this.on = on;
    this.token = token();
    this.asked = new Map();
    this.next = 1;
    addEventListener("hashchange", () => {
      this.token = token();
      if (this.socket) this.socket.close();
      else this.connect();
    });
    this.connect();
    setInterval(() => this.watch(), 200);
  }

  connect() {
    clearTimeout(this.again);
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}/live`);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    this.heard = performance.now();
    socket.onopen = () => socket.send(JSON.stringify({ token: this.token }));
    socket.onmessage = ({ data }) => {
      if (socket !== this.socket) return;
      this.heard = performance.now();
      if (typeof data !== "string") return this.on.blob(data);
      const message = JSON.parse(data);
      if (message.role) {
        this.isOpen = true;
        this.on.role(message.role);
        for (const [id, { order }] of this.asked) this.send(id, order);
      }
      if (message.answer) this.answered(message.answer);
      this.on.message(message);
    };
    socket.onclose = ({ code }) => {
      if (socket !== this.socket) return;
      this.lose(FINAL[code] ?? "this page lost its server and tries again", code in FINAL);
    };
  }

  watch() {
    if (this.isOpen && performance.now() - this.heard > LOST_AFTER_MS) {
      const socket = this.socket;
      this.lose("the server does not answer; this page tries again");
      socket.close();
    }
  }

  lose(why, isFinal = false) {
    this.socket = null;
    this.isOpen = false;
    this.isRefused = isFinal;
    for (const [id, { order }] of this.asked) {
      if (isFinal || !isStop(order)) this.answered({ id, ok: false, text: "the connection ended before the answer; check the state of the robot" });
    }
    this.on.lost(why);
    if (!isFinal) this.again = setTimeout(() => this.connect(), AGAIN_AFTER_MS);
  }

  answered({ id, ok, text }) {
    this.asked.get(id)?.answer({ ok, text });
    this.asked.delete(id);
  }

  /// Sends an order. The answer is the confirmation, or the reason of a failure. A stop is resent
  /// after each loss of the server until it is answered.
  ask(order) {
    if (!this.isOpen && (this.isRefused || !isStop(order))) return Promise.resolve({ ok: false, text: "this page has no connection to its server" });
    const id = this.next++;
    if (this.isOpen) this.send(id, order);
    return new Promise((answer) => this.asked.set(id, { order, answer }));
  }

  send(id, order) {
    this.socket.send(JSON.stringify({ id, ...order }));
  }
}
