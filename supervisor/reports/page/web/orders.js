// Orders of the operator: stop and resume, targets, restarts and kills of stages. The page shows
// the confirmation.

const PREVIEW_EVERY_MS = 250;

const byId = (id) => document.getElementById(id);

export class Orders {
  constructor(net, map) {
    this.net = net;
    this.map = map;
    this.previewed = 0;
    byId("urgent").hidden = false;
    byId("stop").addEventListener("click", () => this.ask("stop", { order: "stop" }));
    byId("resume").addEventListener("click", () => this.ask("resume", { order: "resume" }));
    byId("go").addEventListener("click", () => this.go());
    byId("waypoint").addEventListener("click", () => this.addWaypoint());
    byId("clear").addEventListener("click", () => this.choose([]));
    byId("return").addEventListener("click", () => this.ask("return", { order: "go_back" }));
    byId("stages").addEventListener("click", ({ target }) => {
      const { order, stage } = target.dataset;
      if (order) this.ask(`${order} ${stage}`, { order, stage });
    });
    // The space bar stops the robot with any focus.
    addEventListener("keydown", (event) => {
      if (event.code !== "Space" || event.repeat) return;
      event.preventDefault();
      this.ask("stop", { order: "stop" });
    }, { capture: true });
    addEventListener("keyup", (event) => {
      if (event.code === "Space") event.preventDefault();
    }, { capture: true });
  }

  role(role) {
    const drives = role === "drive";
    document.body.classList.toggle("drive", drives);
    byId("targets").hidden = !drives;
    this.map.mayChoose = drives;
    this.map.changed();
  }

  async ask(name, order) {
    this.say(`${name}: sent`, "");
    const { ok, text } = await this.net.ask(order);
    this.say(ok ? `${name}: ${text}` : `${name} failed: ${text}`, ok ? "good" : "bad");
  }

  say(text, kind) {
    const answer = byId("answer");
    answer.textContent = text;
    answer.className = kind;
  }

  // --- targets ---

  /// Takes the chosen places. `at` is the moved one, and `isDone` means that it is released.
  choose(places, at = places.length - 1, isDone = true) {
    this.map.chosen = places;
    const text = places.map(([x, y]) => `(${x.toFixed(2)}, ${y.toFixed(2)})`).join(" → ");
    byId("chosen").textContent = text || "Tap the map to choose a target.";
    byId("go").disabled = byId("clear").disabled = byId("waypoint").disabled = !places.length;
    if (places.length && at === 0) this.preview(places[0], isDone);
    this.map.changed();
  }

  /// Shows the path to `place`.
  preview([x, y], isDone) {
    const now = performance.now();
    if (!isDone && now - this.previewed < PREVIEW_EVERY_MS) return;
    this.previewed = now;
    this.net.ask({ order: "preview", x, y });
  }

  addWaypoint() {
    const [x, y] = this.map.chosen[this.map.chosen.length - 1];
    this.choose([...this.map.chosen, [x + 0.5, y]]);
  }

  async go() {
    const targets = this.map.chosen;
    await this.ask(targets.length > 1 ? "waypoints" : "target", { order: "go_to", targets });
  }
}
