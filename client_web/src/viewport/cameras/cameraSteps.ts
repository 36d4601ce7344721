/** Buttons that move a camera, by the keys that do the same. */
export const CAMERA_STEPS = [
  { key: "ArrowLeft", sign: "◂", label: "Turn left" },
  { key: "ArrowRight", sign: "▸", label: "Turn right" },
  { key: "ArrowUp", sign: "▴", label: "Turn up" },
  { key: "ArrowDown", sign: "▾", label: "Turn down" },
  { key: "+", sign: "+", label: "Nearer" },
  { key: "-", sign: "−", label: "Farther" },
];
