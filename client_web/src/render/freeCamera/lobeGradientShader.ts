/** How other light than the environment's changes in highlights as they look elsewhere, as `relume.live.free_camera.highlights.lobe_gradients`. */
import type { FreeCameraBody } from "../../protocol";
import { albedoGlsl, albedoStepGlsl, NUM_GROUPS, type TableKinds, luminanceGlsl } from "./dataLayout";

/** Finds `turn`, after the sums of other light. `crossed`: turns incident radiance coefficients to how they change with φ. */
export function lobeGradientGlsl({ table_rows }: FreeCameraBody, { isotropic, anisotropic }: TableKinds, crossed: string): string {
  const groups = isotropic.flatMap((is, group) => (is ? [group] : []));
  const sum = (value: (group: number) => string) => groups.map(value).join(" + ");
  const table = (group: number) => `uHighlights[${group}].z`;
  const groupValue = (group: number) => (anisotropic[group] ? `even(${table(group)}, row, share)` : `beside${group}`);
  const texel = (group: number) => `albedos + ${group}`;
  return `int albedos = (uLobe * ${table_rows} + row) * ${NUM_GROUPS + 1};
  vec3 sent = ${sum(groupValue)}, ofRow = ${sum((group) => `evenStep(${table(group)}, row)`)};
  vec3 white = ${sum((group) => albedoGlsl(texel(group)))}, whiter = ${sum((group) => albedoStepGlsl(texel(group)))};
  ${crossed}
  vec3 crossing = ${sum((group) => `even(${table(group)}, row, share)`)};
  vec3 isLit = vec3(greaterThan(sent, vec3(0.0))) * vec3(greaterThan(white, vec3(1e-6)));
  vec3 weight = isLit * ${luminanceGlsl} / max(white, 1e-6);
  float facing = dot(n, wo), sine = max(sqrt(max(1.0 - facing * facing, 0.0)), 1e-3);
  float rowsARadian = facing < 0.01 ? 0.0 : ${((table_rows - 1) / 2).toFixed(1)} * sqrt(1.0 + cosine);
  float byTheta = rowsARadian * dot(weight, ofRow - sent * whiter / max(white, 1e-6)), byPhi = dot(weight, crossing) / sine;
  turn.xyz = (sp * byPhi - facing * cp * byTheta) * tangent - (cp * byPhi + facing * sp * byTheta) * bitangent - sine * byTheta * n;
  turn.w = dot(turn.xyz, 2.0 * facing * n - wo);`;
}
