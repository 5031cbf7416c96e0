// The serial line: paced as a wire is towards the box, and the receiver's buffer of two bytes,
// which the library leaves out.

import { createServer } from "node:net";

const BYTE_CYCLES = 1389; // 10 bits at 115200 baud
const UCSRA = 0xc0;
const UCSRB = 0xc1;
const UDR = 0xc6;
const RXC = 0x80;
const BUFFER = 2;

export class Serial {
  constructor(board) {
    this.board = board;
    this.queue = [];
    this.taken = [];
    this.lineEnded = false;
    this.sockets = new Set();
    board.afterReset = () => this.attach();
    this.attach();
  }

  listen() {
    this.server = createServer((socket) => {
      this.sockets.add(socket);
      socket.setNoDelay(true);
      socket.on("data", (bytes) => this.send(bytes));
      socket.on("error", () => socket.destroy());
      socket.on("close", () => this.sockets.delete(socket));
    });
    return new Promise((resolve) => {
      this.server.listen(0, "127.0.0.1", () => {
        resolve(`socket://127.0.0.1:${this.server.address().port}`);
      });
    });
  }

  attach() {
    const { board } = this;
    const { cpu, uart } = board;
    this.queue.length = 0; // a reset loses what was on the line
    this.buffer = [];
    // In the library the data register is no longer empty once its interrupt has been taken.
    uart.UDRE.constant = true;
    uart.onByteTransmit = (byte) => this.sent(byte);
    const read = cpu.readHooks[UDR];
    cpu.readHooks[UDR] = (address) => {
      const value = read(address);
      if (this.buffer.length) {
        uart.writeByte(this.buffer.shift(), true);
      }
      return value;
    };
    // The library forgets a byte that has come when anything is written here.
    const write = cpu.writeHooks[UCSRB];
    cpu.writeHooks[UCSRB] = (value, ...rest) => {
      const waiting = cpu.data[UCSRA] & RXC;
      const done = write(value, ...rest);
      if (waiting) {
        cpu.setInterruptFlag(uart.RXC);
      }
      return done;
    };
    const byteTime = () => {
      if (this.queue.length) {
        this.arrive(this.queue.shift());
      }
      cpu.addClockEvent(byteTime, BYTE_CYCLES);
    };
    cpu.addClockEvent(byteTime, BYTE_CYCLES);
  }

  arrive(byte) {
    const { cpu, uart } = this.board;
    this.board.note("rx", byte);
    if (!(cpu.data[UCSRA] & RXC)) {
      uart.writeByte(byte, true);
    } else if (this.buffer.length < BUFFER) {
      this.buffer.push(byte);
    } else {
      this.board.note("overrun", byte);
    }
  }

  sent(byte) {
    this.board.note("tx", byte);
    this.taken.push(byte);
    this.lineEnded ||= byte === 10;
    for (const socket of this.sockets) {
      socket.write(Buffer.of(byte));
    }
  }

  send(bytes) {
    this.queue.push(...bytes);
  }

  take() {
    const taken = Buffer.from(this.taken).toString("hex");
    this.taken.length = 0;
    this.lineEnded = false;
    return taken;
  }
}
