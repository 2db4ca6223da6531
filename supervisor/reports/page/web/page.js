// Page that joins store, map, charts and time line. A live robot adds the connection and the
// orders.

import { Store } from "./store.js";
import { MapView } from "./map.js";
import { Charts } from "./charts.js";
import { Timeline } from "./timeline.js";
import { Hand } from "./hand.js";
import { Orders } from "./orders.js";
import { Net } from "./net.js";

const byId = (id) => document.getElementById(id);

// A recorded page contains its data.
const recording = byId("data");
const store = new Store(!recording);
let asked = false;
let isLost = false;
// Age of an outdated state. A running robot sends several a second.
const OLD_AFTER_S = 1.5;

function changed() {
  if (asked) return;
  asked = true;
  requestAnimationFrame(draw);
}

const timeline = new Timeline(store, !recording, changed);
const map = new MapView(byId("map"), store, changed, (places, at, isDone) => orders?.choose(places, at, isDone));
const charts = new Charts(byId("figures"), store, (t) => timeline.go(t));
let orders = null;
let drawnCharts = 0;

function draw(now) {
  asked = false;
  timeline.tick(now);
  map.draw(timeline.t);
  timeline.draw();
  // Charts cost most, so they are drawn at 5 Hz while time runs.
  if (now - drawnCharts > 200 || !timeline.plays) {
    drawnCharts = now;
    charts.draw(timeline.t);
  }
  drawStatus();
}

/// Returns the current state, independent of the shown time. For a recorded robot, the state at the
/// shown time.
function newest() {
  const state = store.stateAt(recording ? timeline.t : Infinity);
  if (recording && store.summary?.kind && timeline.t >= store.end) return [store.summary.kind, store.summary.outcome];
  if (!store.about) return ["warn", "no robot runs; waiting for one"];
  if (store.problem) return ["bad", store.problem];
  if (!store.running && !recording) return ["warn", `the run ended at ${store.end.toFixed(1)} s; waiting for the next run`];
  if (!state) return ["warn", "the robot starts"];
  return [state.kind, [state.does, state.to_go].filter(Boolean).join("; ")];
}

function drawStatus() {
  let [kind, text] = newest();
  if (!recording && store.age > OLD_AFTER_S && (store.running || isLost)) {
    text += ` (${store.age.toFixed(0)} s ago)`;
    if (kind === "good") kind = "warn";
  }
  if (isLost) [kind, text] = ["bad", `unknown; last known: ${text}`];
  byId("status").textContent = text;
  byId("status").className = document.querySelector("header").className = kind;
  byId("past").hidden = timeline.follows;
  byId("past").textContent = `Shown: ${timeline.t.toFixed(1)} s, ${(store.end - timeline.t).toFixed(1)} s ago.`;
}

/// Shows a run from its beginning.
function begin() {
  const { about } = store;
  byId("title").textContent = about ? `${about.robot} · ${about.mission}` : "firsthand";
  document.title = byId("title").textContent;
  document.body.classList.toggle("simulated", Boolean(about?.simulated));
  map.fit();
  map.legend(byId("legend"));
  charts.make();
  if (timeline.isLive) timeline.follow();
}

function lost(why) {
  isLost = Boolean(why);
  changed();
  document.body.classList.toggle("lost", Boolean(why));
  byId("notice").hidden = !why;
  byId("notice").textContent = why;
}

async function openRecording() {
  document.body.classList.add("recording");
  const text = atob(recording.textContent.trim());
  const bytes = new Uint8Array(text.length);
  for (let at = 0; at < bytes.length; at++) bytes[at] = text.charCodeAt(at);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
  const buffer = await new Response(stream).arrayBuffer();
  const view = new DataView(buffer);
  // Each message has its length and whether it is text, as from a server.
  for (let at = 0; at + 5 <= buffer.byteLength;) {
    const length = view.getUint32(at, true);
    const message = buffer.slice(at + 5, at + 5 + length);
    if (view.getUint8(at + 4) === 0) store.take(JSON.parse(new TextDecoder().decode(message)));
    else store.takeBlob(message);
    at += 5 + length;
  }
  begin();
  showMetrics();
  timeline.go(store.end);
}

/// Shows the metrics of a recorded run, its outcome, and what its recording lacks.
function showMetrics() {
  const { metrics, outcome, remarks = [] } = store.summary ?? {};
  if (!metrics) return;
  byId("metrics-part").hidden = false;
  const paragraphs = [outcome, ...remarks].map((text) => {
    const paragraph = document.createElement("p");
    paragraph.textContent = text;
    return paragraph;
  });
  const table = document.createElement("table");
  for (const texts of metrics) {
    const row = table.insertRow();
    for (const text of texts) row.insertCell().textContent = text;
  }
  byId("metrics").replaceChildren(...paragraphs, table);
}

byId("fit").addEventListener("click", () => map.fit());
byId("field-mode").addEventListener("change", ({ target }) => {
  map.fieldMode = target.value;
  changed();
});
byId("truth").addEventListener("change", ({ target }) => {
  map.showsTruth = target.checked;
  changed();
});
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  map.repaint();
  charts.make();
  changed();
});
/// Uses light colours for paper. Canvases print as lines and letters.
function print(prints) {
  document.documentElement.classList.toggle("print", prints);
  map.repaint();
  charts.make();
  draw(performance.now());
}
addEventListener("beforeprint", () => print(true));
addEventListener("afterprint", () => print(false));
addEventListener("keydown", ({ key, target }) => {
  if (target.tagName === "INPUT" || target.tagName === "SELECT" || target.id === "map") return;
  if (key === "ArrowLeft") timeline.go(timeline.t - 0.5);
  if (key === "ArrowRight") timeline.go(timeline.t + 0.5);
});

if (recording) {
  openRecording();
} else {
  const net = new Net({
    role: (role) => {
      lost("");
      orders.role(role);
    },
    message: (message) => {
      store.take(message);
      if ("about" in message) begin();
      changed();
    },
    blob: (data) => {
      store.takeBlob(data);
      changed();
    },
    lost,
  });
  orders = new Orders(net, map);
  new Hand(orders, byId("by-hand"));
  orders.choose([]);
  // Silence makes the shown state outdated.
  setInterval(changed, 500);
}
