// What keys, fingers and gamepads do while one plays.

/** @type {[string, string][]} */
export const HELP = [
  ["↑ ↓ ← →", "walk and turn"],
  ["W A S D", "walk where you look; drag, or click and move the mouse, to look"],
  ["Shift", "run, or faster"],
  ["B", "pick up"],
  ["N", "put down"],
  ["M", "board or leave a bus or tram"],
  ["<", "get on or off a bicycle"],
  [">", "go through a door"],
  ["X, Z", "sit down or get up, lie down"],
  ["G", "hand over"],
  ["Enter", "talk"],
  ["R, F", "robots: up and down"],
  ["I K J L U O", "an arm's hand: ahead, back, left, right, up, down"],
  ["[ ]", "an arm's grip: close, open"],
  ["V", "through one's own eyes, or from behind"],
  ["Touch", "drag on the left to walk, farther to run; drag on the right to look"],
  ["Gamepad", "sticks walk and look, A does what is at hand, B runs, X puts down, Y goes through a door"],
  ["Esc", "let go: look at the city with the usual keys; click Play to go on"],
  ["?", "this help"],
];
