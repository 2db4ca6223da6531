// Test of the page's connection without a server: node net.mjs net.js
import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";

const sockets = [];
const waiting = [];
globalThis.location = { hash: "#secret", pathname: "/", protocol: "http:", host: "robot" };
globalThis.history = { replaceState() {} };
globalThis.addEventListener = () => {};
globalThis.setInterval = () => {};
globalThis.clearTimeout = () => {};
globalThis.setTimeout = (again) => waiting.push(again);
globalThis.WebSocket = class {
  constructor() {
    this.sent = [];
    sockets.push(this);
  }
  send(text) {
    this.sent.push(JSON.parse(text));
  }
  opens() {
    this.onopen();
    this.says({ role: "drive" });
  }
  says(message) {
    this.onmessage({ data: JSON.stringify(message) });
  }
  orders() {
    return this.sent.filter(({ order }) => order);
  }
};

const text = await readFile(process.argv[2], "utf8");
const { Net } = await import(`data:text/javascript,${encodeURIComponent(text)}`);
const nothing = () => {};
const net = new Net({ message: nothing, blob: nothing, role: nothing, lost: nothing });
const newest = () => sockets.at(-1);
const ends = (code) => {
  newest().onclose({ code });
  waiting.splice(0).forEach((again) => again());
};

// A late token is sent again.
newest().onopen();
ends(4408);
assert.equal(sockets.length, 2, "the page tries again after 4408");

// A stop waits for the connection and is resent until answered. Other orders are not.
const stop = net.ask({ order: "stop" });
assert.equal((await net.ask({ order: "resume" })).ok, false, "only a stop waits");
newest().opens();
const [{ id }] = newest().orders();
assert.deepEqual(newest().orders(), [{ id, order: "stop" }]);
const resume = net.ask({ order: "resume" });
ends(1006);
assert.equal((await resume).ok, false, "its outcome is unknown");
newest().opens();
assert.deepEqual(newest().orders(), [{ id, order: "stop" }]);
newest().says({ answer: { id, ok: true, text: "it stands" } });
assert.deepEqual(await stop, { ok: true, text: "it stands" });
ends(1006);
newest().opens();
assert.deepEqual(newest().orders(), [], "an answered stop is not sent again");

// A wrong token stays wrong.
const before = sockets.length;
ends(4401);
assert.equal(sockets.length, before);
assert.equal((await net.ask({ order: "stop" })).ok, false, "and nothing waits for it");
