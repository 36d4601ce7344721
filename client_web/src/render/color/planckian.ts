/** The Planckian locus: chromaticities of black bodies. */

/** u and v (CIE 1960) of a black body; Krystek 1985, within 1e-4 from 1,000 to 15,000 K. */
export function planckian(kelvin: number): [u: number, v: number] {
  const square = kelvin * kelvin;
  return [
    (0.860117757 + 1.54118254e-4 * kelvin + 1.28641212e-7 * square) /
      (1 + 8.42420235e-4 * kelvin + 7.08145163e-7 * square),
    (0.317398726 + 4.22806245e-5 * kelvin + 4.20481691e-8 * square) /
      (1 - 2.89741816e-5 * kelvin + 1.61456053e-7 * square),
  ];
}
