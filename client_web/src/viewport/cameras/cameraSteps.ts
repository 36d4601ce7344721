/** Camera buttons and their equivalent keys. */
export const CAMERA_STEPS = [
  { key: "ArrowLeft", sign: "◂", label: "Orbit left" },
  { key: "ArrowRight", sign: "▸", label: "Orbit right" },
  { key: "ArrowUp", sign: "▴", label: "Orbit up" },
  { key: "ArrowDown", sign: "▾", label: "Orbit down" },
  { key: "+", sign: "+", label: "Dolly in" },
  { key: "-", sign: "−", label: "Dolly out" },
];
