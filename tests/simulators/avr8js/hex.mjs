// Intel HEX.

export function readHex(text, target) {
  for (const line of text.split("\n")) {
    if (line.startsWith(":") && line.slice(7, 9) === "00") {
      const count = parseInt(line.slice(1, 3), 16);
      const address = parseInt(line.slice(3, 7), 16);
      for (let i = 0; i < count; i++) {
        target[address + i] = parseInt(line.slice(9 + 2 * i, 11 + 2 * i), 16);
      }
    }
  }
}
