/** Controls of principled parameters, and messages about materials that have none. */
import type { MaterialLook, PrincipledParameters } from "../../../protocol";

export interface Control {
  name: keyof PrincipledParameters;
  label: string;
  shortLabel: string;
  title?: string;
  /** The control is shown only if this parameter is not 0. */
  needs?: "coat_weight" | "sheen_weight";
}

export const GROUPS: readonly { title: string; controls: readonly Control[] }[] = [
  {
    title: "Base",
    controls: [
      {
        name: "base_color",
        label: "Base color",
        shortLabel: "Base color",
      },
      { name: "metallic", label: "Metallic", shortLabel: "Metallic" },
      { name: "roughness", label: "Roughness", shortLabel: "Roughness" },
      { name: "specular", label: "Specular", shortLabel: "Specular", title: "Scales the reflection of nonmetals" },
      { name: "ior", label: "Index of refraction", shortLabel: "IOR" },
      { name: "specular_color", label: "Specular color", shortLabel: "Specular color" },
      { name: "anisotropy", label: "Anisotropy", shortLabel: "Anisotropy" },
    ],
  },
  {
    title: "Coat",
    controls: [
      { name: "coat_weight", label: "Coat weight", shortLabel: "Coat" },
      { name: "coat_roughness", label: "Coat roughness", shortLabel: "Coat roughness", needs: "coat_weight" },
    ],
  },
  {
    title: "Sheen",
    controls: [
      { name: "sheen_weight", label: "Sheen weight", shortLabel: "Sheen" },
      { name: "sheen_color", label: "Sheen color", shortLabel: "Sheen color", needs: "sheen_weight" },
      { name: "sheen_roughness", label: "Sheen roughness", shortLabel: "Sheen roughness", needs: "sheen_weight" },
    ],
  },
  {
    title: "Transmission",
    controls: [
      {
        name: "transmission",
        label: "Transmission",
        shortLabel: "Transmission",
        title: "Of materials that are glass in the scene",
      },
    ],
  },
];

/** True if a control changes the material: only glass of the scene transmits, and layers need a weight. */
export function isShown({ name, needs }: Control, parameters: PrincipledParameters, material: MaterialLook): boolean {
  if (name === "transmission") return material.glass !== undefined && material.glass !== null;
  return needs === undefined || parameters[needs] > 0;
}

/** The reason that a material has no principled parameters, and the error of the closest ones. */
export function closestText(reason: string, error: number): string {
  const percent = error < 0.01 ? "less than 1 %" : `${Math.round(100 * error)} %`;
  return `${reason} The closest principled material differs by ${percent} (relative RMS).`;
}
