// Follows the stream of situations and advisories, and loses none: after a lost connection it resumes where it was.
// If revisions were removed meanwhile, it says so and begins anew.
//
//     node examples/follow_stream.mjs http://127.0.0.1:8080 place.json
//
// It needs Node.js 22, or 20.10 with the option --experimental-websocket, and no package. It prints one line for each
// revision, and then writes its position to place.json. So after a crash it may print a revision a second time.
// DECONFLICT_TOKEN is the token of a person of the site file, if the site uses them.

import { existsSync, readFileSync, renameSync, writeFileSync } from "node:fs";

const KINDS = "situation,advisory";
const LONGEST_WAIT_MS = 10_000;
const PERMANENT = new Set([4400, 4422]); // the request is wrong: to send it again helps nothing
const POSITION_LOST = 4416;

if (!globalThis.WebSocket) {
  console.error("This Node.js has no WebSocket: use 22, or start 20 with --experimental-websocket");
  process.exit(2);
}

const [url, place] = process.argv.slice(2);
if (!/^https?:/.test(url ?? "") || !place) {
  console.error("usage: node follow_stream.mjs http://HOST:PORT FILE, where FILE keeps the position");
  process.exit(2);
}
const token = process.env.DECONFLICT_TOKEN;
const headers = token ? { authorization: `Bearer ${token}` } : {};
let seq = existsSync(place) ? JSON.parse(readFileSync(place, "utf8")).seq : null;
let waitMs = 200;
follow();

async function newest() {
  const answer = await fetch(`${url}/situations`, { headers });
  if (!answer.ok) throw new Error(`${answer.status} ${answer.statusText}`);
  return (await answer.json()).seq;
}

async function follow() {
  try {
    seq ??= await newest();
  } catch (error) {
    console.error(`the service does not answer: ${error.message}`);
    again();
    return;
  }
  const stream = new WebSocket(`${url.replace("http", "ws")}/advisories/stream?after=${seq}&kinds=${KINDS}`, { headers });
  stream.onmessage = ({ data }) => {
    const revision = JSON.parse(data);
    console.log(`${revision.seq} ${revision.state} ${revision.kind}: ${revision.summary}`);
    note(revision.seq);
    waitMs = 200;
  };
  // Node.js 20 sends no close event if it could not connect at all, only an error.
  stream.onerror = stream.onclose = ({ code, reason }) => {
    stream.onerror = stream.onclose = null;
    if (PERMANENT.has(code)) {
      console.error(`${code}: ${reason}`);
      process.exit(1);
    }
    if (code === POSITION_LOST) {
      console.error(`${code}: ${reason}`);
      seq = null;
    }
    again();
  };
}

function again() {
  setTimeout(follow, waitMs);
  waitMs = Math.min(2 * waitMs, LONGEST_WAIT_MS);
}

function note(received) {
  seq = received;
  writeFileSync(`${place}.new`, JSON.stringify({ seq }));
  renameSync(`${place}.new`, place); // after a crash the file is the old one or the new one, as a whole
}
