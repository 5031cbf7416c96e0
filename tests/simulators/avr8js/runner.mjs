// Runs the firmware on avr8js. The serial line is a TCP socket; every change of an output is
// logged with its cycle; orders come on standard input (see ../README.md).

import { createInterface } from "node:readline";
import { Board, CLOCK_HZ } from "./board.mjs";
import { Serial } from "./serial.mjs";

const SLICE_CYCLES = CLOCK_HZ / 1000;
const FORGIVEN_MS = 50;

const [, , hexPath, logPath] = process.argv;
const board = new Board(hexPath, logPath);
const serial = new Serial(board);
let pace = "off";
let epoch = 0; // wall clock at cycle 0

const sleepless = () => false;

// The orders that may also come at a cycle; false for others.
function doNow(words) {
  const [order, first, second] = words;
  if (order === "interlock" && (first === "open" || first === "closed")) {
    board.setInterlock(first === "open");
  } else if (order === "reset") {
    board.reset(Number(first));
  } else if (order === "send") {
    serial.send(Buffer.from(first, "hex"));
  } else if (order === "poke") {
    Buffer.from(second, "hex").forEach((byte, i) => board.cpu.writeData(Number(first) + i, byte));
  } else {
    return false;
  }
  return true;
}

// run CYCLES, or: line CYCLES, which stops behind the first line end that the box sends.
function run(order, cycles) {
  board.run(board.cycle + cycles, order === "line" ? () => serial.lineEnded : sleepless);
  return `ok ${board.cycle} ${serial.take()}`;
}

function peek(address, count) {
  return `ok ${Buffer.from(board.cpu.data.slice(address, address + count)).toString("hex")}`;
}

function answer(text) {
  const words = text.trim().split(" ");
  const [order, first, ...rest] = words;
  if (order === "run" || order === "line") {
    return run(order, Number(first));
  } else if (order === "peek") {
    return peek(Number(first), Number(rest[0]));
  } else if (order === "pace") {
    pace = first;
    return "ok";
  } else if (order === "cycle") {
    return `ok ${board.cycle}`;
  } else if (order === "at") {
    board.at(Number(first), () => doNow(rest));
    return "ok";
  }
  return doNow(words) ? "ok" : `error ${text}`;
}

// How far the processor is ahead of the wall clock. A machine too slow for it is forgiven: the
// processor does not run after lost time.
function aheadMs() {
  const due = epoch + (board.cycle / CLOCK_HZ) * 1000;
  const now = performance.now();
  if (Math.abs(due - now) > FORGIVEN_MS) {
    epoch = now - (board.cycle / CLOCK_HZ) * 1000;
    return 0;
  }
  return due - now;
}

function slice() {
  if (pace !== "off" && (pace === "full" || aheadMs() < 1)) {
    board.run(board.cycle + SLICE_CYCLES, sleepless);
    serial.take();
    board.flushLog();
  }
  if (pace === "full" || (pace === "real" && aheadMs() < 1)) {
    setImmediate(slice);
  } else {
    setTimeout(slice, 1);
  }
}

function finish() {
  board.close();
  process.exit(0);
}

console.log(`ready ${await serial.listen()}`);
createInterface({ input: process.stdin })
  .on("line", (text) => {
    if (text === "quit") {
      finish();
    }
    const reply = answer(text);
    board.flushLog(); // before the reply: whoever has it may read the log
    console.log(reply);
  })
  .on("close", finish);
slice();
