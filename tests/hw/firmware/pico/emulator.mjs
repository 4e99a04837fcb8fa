// A Raspberry Pi Pico with a bench, emulated: rp2040js runs the image, this is what the pins are wired to.
//
//     node emulator.mjs FOLDER_OF_RP2040JS
//
// Reads one JSON object a line, answers with one. Time is the emulated clock's and passes only when it is told to:
//
//     {"do": "boot", "flash": HEX, "by_watchdog": BOOL}   power or a reset; ROM's check of boot2, then boot2 itself
//     {"do": "bytes", "data": HEX}       from the line, at 921600 baud from now on
//     {"do": "run", "us": N}             N us, or until a frame has been answered
//     {"do": "sleep", "us": N}           N us
//     {"do": "set", "bench": {...}}     the bench: see `bench` below
//     {"do": "glitch"}                   both wires of the encoder change at once, and back
//     {"do": "hang"}                     the processor takes no interrupt any more
//     {"do": "spans"}                    the longest stays in interrupts are counted anew
//
// An answer has: now (us), out (hex, bytes for the line since the last answer), pins, enables, level (of the four pulse
// width outputs), rate and angle of the shaft, resets, and counts: instructions, cycles and the deepest stack.

import { createRequire } from 'node:module';
import { createInterface } from 'node:readline';

const { RP2040 } = createRequire(import.meta.url)(process.argv[2] + '/dist/cjs/index.js');

const NS_CYCLE = 8, PLANT_NS = 20000, BYTE_NS = 1e10 / 921600;
const SILENT = { debug() {}, info() {}, warn() {}, error() {} };
const STOP = 4, READY = 5, ENABLED = 6, KEY = 7, LOAD_ENABLE = 8, DRIVE_ENABLE = 9, BRAKE = 10;
const SELECT_0 = 12, SELECT_1 = 13;

// What stands around the board, in SI; a test changes it. adc: steps of a channel or input of the multiplexer that are
// not the bench's: "rate", "drive", "load", "temperature", "bus", "reference".
const bench = {
  stop: true, ready: true, key: true, enabled: null, encoder: true, tachometer: true, motor: false,
  temperature: 2000, bus: 1600, reference: 2048, adc: {},
  kt: 0.061, resistance: 2.05, tau_max: 0.144, kt_load: 0.072, inertia: 6.38e-5, f_c: 0.0205, f_v: 2.58e-5,
  f_cut: 50, voltage_full: 24, current_full: 5, current_range: 10, rate_range: 400, encoder_counts: 2000,
};

let mcu, base = 0, flash, out = [], coming = [], resets = 0, due = 0, state, watch, hung = false;
let instructions = 0, cycles = 0, deepest = 0, spans = {};

function boot(byWatchdog) {
  base += mcu ? mcu.clock.nanos : 0;
  const scratch = byWatchdog && mcu ? mcu.peripherals[0x40058].scratchData : null;
  mcu = new RP2040();
  mcu.logger = SILENT;
  mcu.flash.set(flash);
  mcu.sram.fill(0x5a);
  if (bench.stuck) { // a bit of a word of RAM that is 1 for ever
    const [at, bit] = bench.stuck, write = mcu.writeUint32.bind(mcu);
    mcu.writeUint32 = (address, value) => write(address, address >>> 0 === at ? value | 1 << bit : value);
  }
  const dog = mcu.peripherals[0x40058];
  dog.reason = byWatchdog ? 1 : 0;
  if (scratch) dog.scratchData = scratch;
  dog.onWatchdogTrigger = () => { hung = true; dog.alarm.enable = false; }; // or it rings for ever
  mcu.uart[0].onByte = (byte) => out.push(byte);
  mcu.pwm.channels.forEach((channel) => { channel.updateEnable = () => {}; }); // levels are read, edges are not
  mcu.pio.forEach((pio) => { pio.run = () => {}; });
  const read = mcu.pio[0].readUint32.bind(mcu.pio[0]);
  mcu.pio[0].readUint32 = (offset) => {
    if (offset === 4) samples(2); // time that passes while it is asked for a new value
    return read(offset);
  };
  mcu.adc.onADCRead = (channel) => {
    mcu.adc.currentChannel = channel;
    mcu.adc.channelValues[channel] = converted(channel);
    mcu.adc.sampleAlarm.schedule(2000);
  };
  state ??= { rate: 0, filtered: 0, angle: 0, counted: 0, lines: 0 };
  coming = [];
  due = 0;
  hung = false;
  wires();
  // The ROM: 256 bytes into RAM, their CRC, then there.
  let crc = 0xffffffff;
  for (let k = 0; k < 252; k++) {
    crc ^= flash[k] << 24;
    for (let bit = 0; bit < 8; bit++) crc = (crc << 1) ^ (crc & 0x80000000 ? 0x04c11db7 : 0);
  }
  if (crc >>> 0 !== new DataView(flash.buffer, flash.byteOffset).getUint32(252, true)) throw new Error('boot2: wrong CRC');
  mcu.sram.set(flash.slice(0, 256), 0x41f00);
  mcu.core.SP = 0x20041f00;
  mcu.core.PC = 0x20041f00;
  instructions = 0;
  cycles = 0;
  deepest = 0;
}

const pin = (n) => (mcu.sio.gpioValue & mcu.sio.gpioOutputEnable) >>> n & 1;
const level = (slice, half) => (mcu.pwm.channels[slice].cc >>> (16 * half)) & 0xffff;
const share = (slice) => (level(slice, 0) - level(slice, 1)) / 4096;
const driven = () => pin(DRIVE_ENABLE) ? share(0) * bench.voltage_full : 0;
const loaded = () => pin(LOAD_ENABLE) ? share(1) * bench.current_full : 0;
const clamped = (steps) => Math.max(0, Math.min(4095, Math.round(steps)));

function driveCurrent() {
  return Math.max(-bench.tau_max, Math.min(bench.tau_max, bench.kt / bench.resistance * (driven() - bench.kt * state.rate))) / bench.kt;
}

function converted(channel) {
  const own = bench.adc;
  const middle = (value, range) => clamped(2048 + value / range * 2048);
  if (channel === 0) return own.rate ?? middle(bench.tachometer ? state.filtered : 0, bench.rate_range);
  if (channel === 1) return own.drive ?? middle(driveCurrent(), bench.current_range);
  switch (pin(SELECT_0) + 2 * pin(SELECT_1)) {
    case 0: return own.load ?? middle(loaded(), bench.current_range);
    case 1: return own.temperature ?? bench.temperature;
    case 2: return own.bus ?? bench.bus;
    default: return own.reference ?? bench.reference;
  }
}

function samples(count) { for (let k = 0; k < 12 * count; k++) mcu.pio[0].machines[0].step(); }

function wires() {
  mcu.gpio[STOP].setInputValue(bench.stop);
  mcu.gpio[READY].setInputValue(bench.ready);
  mcu.gpio[KEY].setInputValue(bench.key);
  mcu.gpio[ENABLED].setInputValue(bench.enabled ?? !!(pin(LOAD_ENABLE) | pin(DRIVE_ENABLE)));
}

function plant(seconds) {
  const closed = !pin(BRAKE);
  const tau = driveCurrent() * bench.kt + loaded() * bench.kt_load - bench.f_v * state.rate;
  const dry = bench.f_c + (closed ? 0.5 : 0);
  let rate = state.rate + tau / bench.inertia * seconds;
  const stops = dry / bench.inertia * seconds;
  rate = Math.abs(rate) <= stops ? 0 : rate - Math.sign(rate) * stops;
  if (bench.turned !== undefined) rate = bench.turned;
  state.angle += (state.rate + rate) / 2 * seconds;
  state.rate = rate;
  state.filtered += (rate - state.filtered) * (1 - Math.exp(-seconds * 2 * Math.PI * bench.f_cut / Math.SQRT2));
  const counts = Math.floor(state.angle * bench.encoder_counts / (2 * Math.PI));
  while (bench.encoder && state.counted !== counts) {
    state.counted += Math.sign(counts - state.counted);
    const phase = state.counted & 3;
    mcu.gpio[2].setInputValue(phase === 1 || phase === 2);
    mcu.gpio[3].setInputValue(phase >= 2);
    samples(2);
  }
  wires();
}

function advance(until, untilAnswered) {
  const { clock, core } = mcu;
  while (clock.nanos < until) {
    if (hung) {
      resets++;
      const left = until - clock.nanos;
      boot(true);
      return advance(mcu.clock.nanos + left, untilAnswered);
    }
    if (bench.motor && clock.nanos >= due) {
      plant(PLANT_NS * 1e-9);
      due = Math.max(due + PLANT_NS, clock.nanos);
    }
    while (coming.length && coming[0][0] <= clock.nanos && !mcu.uart[0].rxFIFO.full) mcu.uart[0].feedByte(coming.shift()[1]);
    if (core.waiting && !core.interruptsUpdated) {
      if (untilAnswered && out.at(-1) === 0 && !coming.length) return;
      let next = until;
      if (mcu.clock.nextAlarm) next = Math.min(next, mcu.clock.nextAlarm.nanos);
      if (coming.length) next = Math.min(next, coming[0][0]);
      if (bench.motor) next = Math.min(next, due);
      clock.tick(Math.max(next - clock.nanos, NS_CYCLE));
      if (core.waiting && core.checkForInterrupts()) core.waiting = false;
      continue;
    }
    const passed = core.executeInstruction();
    instructions++;
    cycles += passed;
    if (core.SP < 0x20040000) deepest = Math.max(deepest, watch - core.SP);
    clock.tick(passed * NS_CYCLE);
    span(core, passed);
  }
}

// The longest stay in each interrupt, in instructions and cycles. Cortex-M0+: IPSR is its number, 0 outside.
let inside = 0, stayed = [0, 0];
function span(core, passed) {
  if (core.IPSR !== inside) {
    if (inside) {
      const most = (spans[inside] ??= [0, 0]);
      most[0] = Math.max(most[0], stayed[0]);
      most[1] = Math.max(most[1], stayed[1]);
    }
    inside = core.IPSR;
    stayed = [0, 0];
  }
  stayed[0]++;
  stayed[1] += passed;
}

function answered() {
  const found = {
    now: (base + mcu.clock.nanos) / 1000, out: Buffer.from(out).toString('hex'), pins: mcu.sio.gpioValue >>> 0,
    enables: mcu.sio.gpioOutputEnable >>> 0, level: [level(0, 0), level(0, 1), level(1, 0), level(1, 1)],
    rate: state.rate, angle: state.angle, resets, instructions, cycles, deepest, spans,
  };
  out = [];
  return found;
}

for await (const line of createInterface({ input: process.stdin })) {
  const asked = JSON.parse(line);
  switch (asked.do) {
    case 'boot':
      flash = Uint8Array.from(Buffer.from(asked.flash, 'hex'));
      watch = asked.stack;
      Object.assign(bench, asked.bench);
      boot(asked.by_watchdog);
      break;
    case 'bytes': {
      let at = Math.max(mcu.clock.nanos, coming.length ? coming.at(-1)[0] : 0);
      for (const byte of Buffer.from(asked.data, 'hex')) coming.push([(at += BYTE_NS), byte]);
      break;
    }
    case 'run': advance(mcu.clock.nanos + asked.us * 1000, true); break;
    case 'sleep': advance(mcu.clock.nanos + asked.us * 1000, false); break;
    case 'spans': spans = {}; break;
    case 'glitch': // both wires of the encoder change at once, and back
      for (let k = 0; k < 2; k++) {
        for (const n of [2, 3]) mcu.gpio[n].setInputValue(!mcu.gpio[n].rawInputValue);
        samples(2);
      }
      break;
    case 'hang': mcu.core.interruptsUpdated = false; mcu.core.checkForInterrupts = () => false; break;
    case 'set': Object.assign(bench, asked.bench); wires(); break;
  }
  process.stdout.write(JSON.stringify(answered()) + '\n');
}
