/** The import options: one list that the form is made from. */
import type { ImportOptions } from "../protocol";

export interface ImportOption<Key extends keyof ImportOptions = keyof ImportOptions> {
  key: Key;
  label: string;
  help: string;
  /** None for a text or a number. */
  choices: readonly { value: ImportOptions[Key]; label: string }[];
}

/** All options with all their values; a new one of the server does not compile until it is listed. */
const OPTIONS: { readonly [Key in keyof ImportOptions]: Omit<ImportOption<Key>, "key"> } = {
  up: {
    label: "Up axis",
    help: "Axis of the file that points up",
    choices: [
      { value: "file", label: "As in file" },
      { value: "y", label: "+Y" },
      { value: "z", label: "+Z" },
      { value: "-z", label: "−Z" },
    ],
  },
  unit: {
    label: "Unit",
    help: "Unit of the file's coordinates",
    choices: [
      { value: "file", label: "As in file" },
      { value: "auto", label: "Guess from size" },
      { value: "m", label: "Meters" },
      { value: "cm", label: "Centimeters" },
      { value: "mm", label: "Millimeters" },
      { value: "in", label: "Inches" },
      { value: "ft", label: "Feet" },
    ],
  },
  recenter: {
    label: "Recenter",
    help: "Move the middle of the scene to the origin",
    choices: [
      { value: "auto", label: "If far away" },
      { value: "always", label: "Always" },
      { value: "never", label: "Never" },
    ],
  },
  light_unit: {
    label: "Lights",
    help: "Unit of lights in a glTF file; Blender writes W/sr as “Unitless”, and W as “Raw”",
    choices: [
      { value: "file", label: "As in file" },
      { value: "W/sr", label: "W/sr" },
      { value: "W", label: "W" },
    ],
  },
  scene_name: { label: "Scene", help: "Name or number of one scene, of a glTF file with several", choices: [] },
  time: { label: "Time", help: "Moment of the animation: seconds, or the time code of USD", choices: [] },
};
const NO_TEXT: Partial<ImportOptions> = { scene_name: "", time: null };

export const IMPORT_OPTIONS: readonly ImportOption[] = Object.entries(OPTIONS).map(
  ([key, option]) => ({ key, ...option }) as ImportOption,
);

/** The first choice of each option; no text, no number. */
export const DEFAULT_OPTIONS = Object.fromEntries(
  IMPORT_OPTIONS.map(({ key, choices }) => [key, choices[0]?.value ?? NO_TEXT[key]]),
) as unknown as ImportOptions;

/** The options that are not the defaults, as text: "Up axis +Z, Unit Millimeters"; empty without any. */
export function optionsText(options: ImportOptions): string {
  return IMPORT_OPTIONS.filter(({ key }) => options[key] !== DEFAULT_OPTIONS[key])
    .map(
      ({ key, label, choices }) =>
        `${label} ${choices.find(({ value }) => value === options[key])?.label ?? options[key]}`,
    )
    .join(", ");
}

export function areSameOptions(a: ImportOptions, b: ImportOptions): boolean {
  return IMPORT_OPTIONS.every(({ key }) => a[key] === b[key]);
}
