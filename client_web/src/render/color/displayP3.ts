/** Display P3 (SMPTE EG 432-1 with the white and the curve of sRGB). */
import type { Matrix } from "./whiteBalance";

/** Linear Rec. 709 to linear Display P3; both have the white D65. */
export const REC709_TO_P3: Matrix = [
  [0.8224619687, 0.1775380313, 0],
  [0.0331941989, 0.9668058011, 0],
  [0.0170826307, 0.0723974407, 0.9105199286],
];
