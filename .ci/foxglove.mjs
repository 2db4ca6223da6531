// Reads the messages for viewers with the packages by which Foxglove and Lichtblick read them, and checks that these can draw
// them:
//   node foxglove.mjs recording FILE [SENSOR POINTS]
//   node foxglove.mjs live ws://ADDRESS:PORT
// SENSOR is the sensor whose scans are checked, and POINTS the number of points in each scan that has any.
import assert from "node:assert/strict";
import { open } from "node:fs/promises";
import internal from "@foxglove/schemas/internal.js";
import rosmsg from "@foxglove/rosmsg";
import ros2 from "@foxglove/rosmsg2-serialization";
import wsProtocol from "@foxglove/ws-protocol";
import { McapIndexedReader } from "@mcap/core";
import mcapNode from "@mcap/nodejs";
import { loadDecompressHandlers, protobufFromBinaryDescriptor } from "@mcap/support";
import { WebSocket } from "ws";

/** Longest time that a live robot may take to show everything. */
const PATIENCE_MS = 120_000;

const [kind, place, sensor = "front", points = "9"] = process.argv.slice(2);

/** The decoder of a channel, from the schema that came with it, as viewers make it. */
function decoder({ encoding, schemaName, schemaEncoding, schema }) {
  if (encoding === "cdr" && schemaEncoding === "ros2msg") {
    const text = new TextDecoder().decode(schema);
    const reader = new ros2.MessageReader(rosmsg.parse(text, { ros2: true }));
    return (data) => reader.readMessage(data);
  }
  if (encoding === "json" && schemaEncoding === "jsonschema") {
    const { properties } = JSON.parse(new TextDecoder().decode(schema));
    assert.ok(properties, `the schema ${schemaName} has no properties, so viewers show nothing of it`);
    return (data) => JSON.parse(new TextDecoder().decode(data));
  }
  assert.deepEqual([encoding, schemaEncoding], ["protobuf", "protobuf"], schemaName);
  const root = protobufFromBinaryDescriptor(schema);
  root.resolveAll();
  const type = root.lookupType(schemaName);
  const known = internal.foxgloveMessageSchemas[schemaName.replace("foxglove.", "")];
  assert.ok(known, `viewers do not know ${schemaName}`);
  const names = (fields) => fields.map((field) => field.name).sort();
  assert.deepEqual(names(type.fieldsArray), names(known.fields), schemaName);
  return (data) => type.toObject(type.decode(data), { defaults: true, longs: Number });
}

/** What came so far. */
class Seen {
  parents = new Map();
  frames = new Set();
  poses = [];
  topics = new Set();
  problem = "nothing came";

  message(topic, schemaName, message) {
    this.topics.add(topic);
    const framed = message.entities ?? [message];
    framed.forEach(({ frame_id: frame }) => frame !== undefined && this.frames.add(frame));
    switch (schemaName) {
      case "foxglove.FrameTransforms":
        for (const { parent_frame_id: parent, child_frame_id: child, rotation } of message.transforms) {
          assert.ok(Math.abs(Math.hypot(rotation.x, rotation.y, rotation.z, rotation.w) - 1) < 1e-9, child);
          this.parents.set(child, parent);
        }
        break;
      case "foxglove.PoseInFrame":
        this.poses.push(message.pose.position);
        break;
      case "foxglove.Odometry":
        assert.equal(message.pose_covariance.length, 36);
        this.variance = message.pose_covariance[0];
        break;
      case "foxglove.Grid":
        this.grid(message);
        break;
      case "foxglove.LaserScan":
        // Viewers divide by the number of angles between points.
        assert.notEqual(message.ranges.length, 1, topic);
        if (topic === `foxglove/scan/${sensor}` && message.ranges.length > 1) {
          assert.equal(message.ranges.length, Number(points), topic);
          assert.ok(message.end_angle > message.start_angle, topic);
          // A beam without a reading is no number.
          this.range = Math.min(this.range ?? Infinity, ...message.ranges.filter(Number.isFinite));
        }
        break;
      case "foxglove.SceneUpdate":
        this.scene = message.entities.map((entity) => entity.id).sort();
        break;
    }
  }

  grid({ data, column_count: columns, row_stride: row, cell_stride: cell, fields, cell_size: size }) {
    assert.equal(row, columns * cell);
    assert.equal(data.length, columns * row, "the map is square");
    assert.ok(size.x > 0 && size.x === size.y);
    assert.deepEqual(fields.map(({ name, type }) => [name, type]), 
      ["state", "red", "green", "blue", "alpha"].map((name) => [name, 1]));
    const at = Object.fromEntries(fields.map(({ name, offset }) => [name, offset]));
    this.columns = columns;
    this.occupied = 0;
    for (let index = 0; index < data.length; index += cell) {
      // The hazard was sensed.
      if (data[index + at.state] === 1) {
        assert.equal(data[index + at.alpha], 255);
        this.occupied += 1;
      }
    }
  }

  /** Whether everything was drawn that should be. */
  isComplete() {
    const rooted = (frame) => frame === "map" || (this.parents.has(frame) && rooted(this.parents.get(frame)));
    const apart = (axis) => Math.max(...this.poses.map(axis)) - Math.min(...this.poses.map(axis));
    const wanted = {
      "the transforms map -> base_link -> sensor": this.parents.get("base_link") === "map" && this.parents.get(sensor) === "base_link",
      "a transform for each frame": [...this.frames].every(rooted),
      "a pose that moves": this.poses.length > 1 && Math.hypot(apart((p) => p.x), apart((p) => p.y)) > 0.1,
      "a covariance": this.variance > 0,
      "a map": this.columns >= 10,
      "an occupied cell": this.occupied > 0,
      "a scan with ranges": this.range > 0 && this.range < 3,
      "trajectory, targets and robot": this.scene?.join() === "robot,targets,trajectory",
      "the topics and the log": ["pose", "command", "log"].every((topic) => this.topics.has(topic)),
    };
    this.problem = Object.keys(wanted).filter((name) => !wanted[name]).join("; ");
    return this.problem === "";
  }

  assertComplete() {
    assert.ok(this.isComplete(), `viewers would not see ${this.problem}`);
    console.log(`drawn: ${this.poses.length} poses, a map of ${this.columns} x ${this.columns} cells with ` +
      `${this.occupied} occupied, ${this.parents.size} transforms, ${this.topics.size} topics`);
  }
}

async function recording(path) {
  const seen = new Seen();
  const file = await open(path);
  const readable = new mcapNode.FileHandleReadable(file);
  const decompressHandlers = await loadDecompressHandlers();
  const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
  const decoders = new Map();
  for (const channel of reader.channelsById.values()) {
    const { name: schemaName, encoding: schemaEncoding, data: schema } = reader.schemasById.get(channel.schemaId);
    const decode = decoder({ encoding: channel.messageEncoding, schemaName, schemaEncoding, schema });
    decoders.set(channel.id, { topic: channel.topic, schemaName, decode });
  }
  for await (const { channelId, data } of reader.readMessages()) {
    const { topic, schemaName, decode } = decoders.get(channelId);
    seen.message(topic, schemaName, decode(data));
  }
  await file.close();
  seen.assertComplete();
}

function connect(url) {
  // Lichtblick offers both protocols.
  const ws = new WebSocket(url, [wsProtocol.FoxgloveClient.SUPPORTED_SUBPROTOCOL, "foxglove.sdk.v1"]);
  return { ws, client: new wsProtocol.FoxgloveClient({ ws }) };
}

async function live(url) {
  const seen = new Seen();
  // A client that wants everything and reads nothing delays no other.
  const stalled = connect(url);
  stalled.client.on("advertise", (channels) => {
    channels.forEach(({ id }) => stalled.client.subscribe(id));
    stalled.ws.pause();
  });
  const { client } = connect(url);
  await new Promise((resolve, reject) => {
    setTimeout(() => reject(new Error(`after ${PATIENCE_MS / 1000} s: ${seen.problem}`)), PATIENCE_MS).unref();
    const subscribed = new Map();
    // An error that a listener throws fails the test.
    const on = (event, listener) => client.on(event, (value) => {
      try {
        listener(value);
      } catch (error) {
        reject(error);
      }
    });
    on("error", reject);
    on("close", () => reject(new Error(`the server closed the connection: ${seen.problem}`)));
    on("serverInfo", ({ capabilities }) => assert.deepEqual(capabilities, [], "viewers may only watch"));
    on("advertise", (channels) => {
      for (const channel of channels) {
        const text = channel.schemaEncoding === "protobuf" ? "base64" : "utf8";
        const decode = decoder({ ...channel, schema: Buffer.from(channel.schema, text) });
        subscribed.set(client.subscribe(channel.id), { ...channel, decode });
      }
    });
    on("message", ({ subscriptionId, data }) => {
      const { topic, schemaName, decode } = subscribed.get(subscriptionId);
      seen.message(topic, schemaName, decode(new Uint8Array(data.buffer, data.byteOffset, data.byteLength)));
      if (seen.isComplete()) {
        resolve();
      }
    });
  });
  client.close();
  stalled.ws.terminate();
  seen.assertComplete();
}

await { recording, live }[kind](place);
