// The ATmega328P with the firmware in it: pins, resets, memory, log of edges.

import { closeSync, openSync, readFileSync, writeSync } from "node:fs";
import {
  AVREEPROM,
  AVRIOPort,
  AVRTimer,
  AVRUSART,
  AVRWatchdog,
  CPU,
  EEPROMMemoryBackend,
  avrInstruction,
  eepromConfig,
  portBConfig,
  portCConfig,
  portDConfig,
  timer1Config,
  usart0Config,
  watchdogConfig,
} from "avr8js";
import { readHex } from "./hex.mjs";

export const CLOCK_HZ = 16_000_000;

const FLASH_BYTES = 0x8000;
const SRAM_BYTES = 2048;
const EEPROM_BYTES = 1024;
const RAM_BEGIN = 0x100;
const MCUSR = 0x54;
const PORF = 1;
const INTERLOCK_PIN = 4;
const SLEEP = 0x9588;

export class Board {
  constructor(hexPath, logPath) {
    this.program = new Uint16Array(FLASH_BYTES / 2);
    readHex(readFileSync(hexPath, "ascii"), new Uint8Array(this.program.buffer));
    this.log = openSync(logPath, "w");
    this.lines = [];
    this.levels = new Array(17).fill(0);
    this.eeprom = new EEPROMMemoryBackend(EEPROM_BYTES);
    this.cyclesBefore = 0;
    this.interlockOpen = false;
    this.timed = [];
    this.afterReset = () => {};
    this.build(new Uint8Array(SRAM_BYTES).fill(0xa5), PORF);
  }

  // Cycles since the power came first.
  get cycle() {
    return this.cyclesBefore + this.cpu.cycles;
  }

  note(what, value) {
    this.lines.push(`${this.cycle} ${what} ${value}\n`);
  }

  flushLog() {
    writeSync(this.log, this.lines.join(""));
    this.lines.length = 0;
  }

  close() {
    this.flushLog();
    closeSync(this.log);
  }

  // A reset is a new processor with the old RAM: the library's own reset leaves its peripherals
  // as they are.
  build(sram, flags) {
    this.cpu = new CPU(this.program, SRAM_BYTES);
    this.cpu.data.set(sram, RAM_BEGIN);
    this.cpu.data[MCUSR] = flags;
    this.portB = new AVRIOPort(this.cpu, portBConfig);
    this.portC = new AVRIOPort(this.cpu, portCConfig);
    this.portD = new AVRIOPort(this.cpu, portDConfig);
    this.watch(this.portC, 0x3f, 1);
    this.watch(this.portD, 0xfc, 5);
    this.watch(this.portB, 0x0f, 13);
    new AVRTimer(this.cpu, timer1Config);
    this.uart = new AVRUSART(this.cpu, usart0Config, CLOCK_HZ);
    new AVREEPROM(this.cpu, this.eeprom, eepromConfig);
    this.watchdog = new AVRWatchdog(this.cpu, watchdogConfig, { frequency: CLOCK_HZ });
    this.cpu.reset = () => {
      this.watchdogBites = true;
    };
    this.watchdogBites = false;
    this.note("reset", flags);
    this.levels.forEach((level, output) => {
      this.setLevel(output, 0); // the pins are inputs now, which a resistor pulls low
    });
    this.setInterlock(this.interlockOpen);
    this.afterReset();
  }

  reset(flags) {
    const sram = this.cpu.data.slice(RAM_BEGIN, RAM_BEGIN + SRAM_BYTES);
    this.cyclesBefore = this.cycle;
    this.build(flags & PORF ? sram.fill(0xa5) : sram, flags);
  }

  // Log the outputs of a port; bit 0 would be output `first`.
  watch(port, mask, first) {
    port.addListener((value, before) => {
      const changed = (value ^ before) & mask;
      for (let bit = 0; bit < 8; bit++) {
        if (changed & (1 << bit)) {
          this.setLevel(first + bit, (value >> bit) & 1);
        }
      }
    });
  }

  setLevel(output, level) {
    if (this.levels[output] !== level) {
      this.levels[output] = level;
      this.note(output, level);
    }
  }

  setInterlock(open) {
    this.interlockOpen = open;
    this.portB.setPin(INTERLOCK_PIN, open);
  }

  at(cycle, action) {
    this.timed.push({ cycle, action });
    this.timed.sort((a, b) => a.cycle - b.cycle);
  }

  // Run to the first instruction at or behind a cycle, or until stop().
  run(until, stop) {
    while (this.cycle < until && !stop()) {
      const due = this.timed[0]?.cycle ?? Infinity;
      if (due <= this.cycle) {
        this.timed.shift().action();
      }
      const { cpu } = this;
      const end = Math.min(until, this.timed[0]?.cycle ?? Infinity) - this.cyclesBefore;
      this.runUntil(cpu, end, stop);
      if (this.watchdogBites) {
        this.reset(0x08);
      }
    }
  }

  runUntil(cpu, end, stop) {
    while (cpu.cycles < end && !this.watchdogBites && !stop()) {
      const { pc } = cpu;
      avrInstruction(cpu);
      cpu.tick();
      if (this.program[pc] === SLEEP) {
        this.sleep(cpu, pc + 1, end);
      }
    }
  }

  // The library runs on after SLEEP. Here the processor waits until an interrupt has taken it
  // away from the instruction behind.
  sleep(cpu, behind, end) {
    while (cpu.pc === behind && cpu.cycles < end && !this.watchdogBites) {
      cpu.cycles = Math.max(cpu.cycles, Math.min(cpu.nextClockEvent?.cycles ?? end, end));
      cpu.tick();
    }
  }
}
