/** Camera buttons and their equivalent keys. */
import type { NavigationMode } from "./navigation";

interface CameraStep {
  key: string;
  sign: string;
  label: string;
}

export const CAMERA_STEPS: Record<NavigationMode, readonly CameraStep[]> = {
  orbit: [
    { key: "ArrowLeft", sign: "◂", label: "Orbit left" },
    { key: "ArrowRight", sign: "▸", label: "Orbit right" },
    { key: "ArrowUp", sign: "▴", label: "Orbit up" },
    { key: "ArrowDown", sign: "▾", label: "Orbit down" },
    { key: "+", sign: "+", label: "Dolly in" },
    { key: "-", sign: "−", label: "Dolly out" },
  ],
  walk: [
    { key: "ArrowLeft", sign: "◂", label: "Turn left" },
    { key: "ArrowRight", sign: "▸", label: "Turn right" },
    { key: "ArrowUp", sign: "▴", label: "Step forward" },
    { key: "ArrowDown", sign: "▾", label: "Step back" },
    { key: "+", sign: "+", label: "Dolly in" },
    { key: "-", sign: "−", label: "Dolly out" },
  ],
};

export const NAVIGATION_LABELS: Record<NavigationMode, string> = { orbit: "Orbit", walk: "Walk" };
export const NAVIGATION_HELP: Record<NavigationMode, string> = {
  orbit: "Drag to orbit, right-drag to look around, Shift-drag to pan, scroll to dolly.",
  walk: "W A S D to walk, Q and E for down and up, Shift is faster, drag to look around, scroll to dolly.",
};
