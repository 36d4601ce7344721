/** Gradient of highlights from light other than the environment with respect to the lobe direction, as
 * `relume.live.free_camera.highlights.lobe_gradients`. */
import type { FreeCameraBody } from "../../protocol";
import { albedoGlsl, albedoStepGlsl, NUM_GROUPS, type TableKinds, luminanceGlsl } from "./dataLayout";

/** Computes `gradient`, after the sums of other light. `crossed`: the incident radiance coefficients' derivative by φ. */
export function lobeGradientGlsl(
  { table_rows }: FreeCameraBody,
  { isotropic, anisotropic }: TableKinds,
  crossed: string,
): string {
  const groups = isotropic.flatMap((is, group) => (is ? [group] : []));
  const sum = (value: (group: number) => string) => groups.map(value).join(" + ");
  const table = (group: number) => `uHighlights[${group}].z`;
  const groupValue = (group: number) =>
    anisotropic[group] ? `isotropic(${table(group)}, row, fraction)` : `beside${group}`;
  const texel = (group: number) => `albedos + ${group}`;
  return `int albedos = (uLobe * ${table_rows} + row) * ${NUM_GROUPS + 1};
  vec3 outgoing = ${sum(groupValue)}, rowStep = ${sum((group) => `isotropicStep(${table(group)}, row)`)};
  vec3 white = ${sum((group) => albedoGlsl(texel(group)))}, whiteStep = ${sum((group) => albedoStepGlsl(texel(group)))};
  ${crossed}
  vec3 derivative = ${sum((group) => `isotropic(${table(group)}, row, fraction)`)};
  vec3 isLit = vec3(greaterThan(outgoing, vec3(0.0))) * vec3(greaterThan(white, vec3(1e-6)));
  vec3 weight = isLit * ${luminanceGlsl} / max(white, 1e-6);
  float facing = dot(n, wo), sine = max(sqrt(max(1.0 - facing * facing, 0.0)), 1e-3);
  float rowsPerRadian = facing < 0.01 ? 0.0 : ${((table_rows - 1) / 2).toFixed(1)} * sqrt(1.0 + cosine);
  float byTheta = rowsPerRadian * dot(weight, rowStep - outgoing * whiteStep / max(white, 1e-6)), byPhi = dot(weight, derivative) / sine;
  gradient.xyz = (sp * byPhi - facing * cp * byTheta) * tangent - (cp * byPhi + facing * sp * byTheta) * bitangent - sine * byTheta * n;
  gradient.w = dot(gradient.xyz, 2.0 * facing * n - wo);`;
}
