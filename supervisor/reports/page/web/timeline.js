// Shown mission time: the newest of a live run, or any stored one. Lists and tables at that time.

const byId = (id) => document.getElementById(id);
const MOST_LISTED = 400;

export class Timeline {
  /// `changed` requests a redraw.
  constructor(store, isLive, changed) {
    this.store = store;
    this.changed = changed;
    this.isLive = isLive;
    this.follows = isLive;
    this.plays = isLive;
    this.t = 0;
    this.listed = {};
    this.at = null;
    byId("time").addEventListener("input", ({ target }) => this.go(Number(target.value)));
    byId("live").addEventListener("click", () => this.follow());
    byId("play").addEventListener("click", () => this.playOrPause());
    byId("logs").addEventListener("change", () => changed());
  }

  /// Shows `t`, and stays there.
  go(t) {
    this.t = Math.min(Math.max(t, this.store.start), this.store.end);
    this.follows = this.plays = false;
    this.changed();
  }

  follow() {
    this.follows = this.plays = this.isLive;
    this.changed();
  }

  playOrPause() {
    if (this.follows) return this.go(this.store.end);
    if (!this.plays && this.t >= this.store.end) this.t = this.store.start;
    this.plays = !this.plays;
    this.changed();
  }

  /// Advances the time. `now` is in milliseconds.
  tick(now) {
    const since = this.at === null ? 0 : (now - this.at) / 1000;
    this.at = now;
    if (this.follows) {
      this.t = this.store.end;
    } else if (this.plays) {
      this.t = Math.min(this.t + since * (this.isLive ? 1 : Number(byId("speed").value)), this.store.end);
      if (this.t >= this.store.end && !this.isLive) this.plays = false;
      this.changed();
    } else {
      this.at = null;
    }
  }

  draw() {
    const { start, end } = this.store;
    const slider = byId("time");
    [slider.min, slider.max, slider.value] = [start, end, this.t];
    byId("now").textContent = `${this.t.toFixed(1)} s`;
    byId("play").textContent = this.plays ? "Pause" : "Play";
    byId("live").setAttribute("aria-pressed", this.follows);
    this.drawStages();
    const shows = byId("logs").checked;
    this.drawList("events", this.store.events.filter((event) => shows || event.kind !== "log"));
    byId("results-part").hidden = !this.store.results.length;
    this.drawList("results", this.store.results);
  }

  drawStages() {
    const state = this.store.stateAt(this.t);
    const body = byId("stages");
    const key = state && `${state.t} ${this.follows}`;
    if (!state) return body.replaceChildren();
    if (this.stagesOf === key) return;
    this.stagesOf = key;
    // Buttons persist, so that no tap is lost between two states.
    const rows = [...state.stages, { name: "supervisor", state: state.order, ...state.supervisor }];
    while (body.rows.length > rows.length) body.deleteRow(-1);
    rows.forEach((stage, at) => {
      const row = body.rows[at] ?? this.newRow(body);
      const percent = typeof stage.cpu === "number" ? `${(stage.cpu * 100).toFixed(0)} %` : "–";
      const memory = stage.memory ? `${(stage.memory / 1e6).toFixed(1)} MB` : "–";
      const seconds = (value) => (typeof value === "number" ? `${value.toFixed(1)} s` : "–");
      const texts = [stage.name, stage.state, stage.generation ?? "–", stage.restarts ?? "–", seconds(stage.age_s), seconds(stage.beat_s), percent, memory];
      texts.forEach((text, column) => {
        if (row.cells[column].textContent !== `${text}`) row.cells[column].textContent = text;
      });
      row.cells[1].className = stage.pid === 0 || ["down", "held", "backing off"].includes(stage.state) ? "bad" : "";
      const buttons = row.cells[8].querySelectorAll("button");
      buttons.forEach((button) => {
        button.dataset.stage = stage.name;
        button.hidden = stage.name === "supervisor";
      });
    });
  }

  newRow(body) {
    const row = body.insertRow();
    for (let column = 0; column < 9; column++) row.insertCell();
    row.cells[3].className = row.cells[5].className = "roomy";
    row.cells[6].className = "live roomy";
    row.cells[7].className = "live roomy";
    row.cells[8].className = "drive simulated";
    for (const order of ["restart", "kill"]) {
      const button = document.createElement("button");
      button.dataset.order = order;
      button.textContent = order;
      row.cells[8].append(button);
    }
    return row;
  }

  /// Draws `all`, newest first. Each item links to its time.
  drawList(id, all) {
    const events = all.slice(-MOST_LISTED);
    const last = events[events.length - 1];
    const key = `${all.length} ${last?.t} ${last?.text}`;
    const list = byId(id);
    if (key !== this.listed[id]) {
      this.listed[id] = key;
      list.replaceChildren(...events.reverse().map((event) => this.eventItem(event)));
    }
    for (const item of list.children) item.classList.toggle("later", Number(item.dataset.t) > this.t + 1e-6);
  }

  eventItem(event) {
    const item = document.createElement("li");
    item.dataset.t = event.t;
    const button = document.createElement("button");
    button.className = event.kind;
    for (const text of [`${event.t.toFixed(1)} s`, event.of, event.text]) {
      const span = document.createElement("span");
      span.textContent = text;
      button.append(span);
    }
    button.addEventListener("click", () => this.go(event.t));
    item.append(button);
    return item;
  }
}
