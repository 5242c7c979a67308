//! Measured figures of the body: control points in millimetres, left half, soles at y = 0.
//!
//! The proportions were measured on the male body surface of the Max Planck Society's SMPL (CC BY 4.0, through
//! odedstein-meshes) as rings around trunk and limbs, made symmetric and rounded to millimetres. They are control
//! points of a subdivision surface, not points of that surface.

/// A point in millimetres.
pub(super) type Figure = [i16; 3];

/// Trunk rings run from the front midline over the left side to the back midline.
#[rustfmt::skip]
pub(super) const SEAT: [Figure; 7] = [
    [0, 870, 161], [86, 888, 125], [168, 901, 98], [196, 902, 21], [167, 897, -68], [99, 896, -136],
    [0, 902, -126],
];
#[rustfmt::skip]
pub(super) const HIPS: [Figure; 7] = [
    [0, 960, 159], [80, 969, 126], [154, 981, 87], [188, 983, 21], [160, 977, -62], [94, 974, -125],
    [0, 976, -124],
];
#[rustfmt::skip]
pub(super) const WAIST: [Figure; 7] = [
    [0, 1089, 199], [84, 1091, 164], [139, 1098, 93], [170, 1096, 27], [151, 1089, -46], [75, 1082, -82],
    [0, 1083, -62],
];
#[rustfmt::skip]
pub(super) const RIBS: [Figure; 7] = [
    [0, 1212, 158], [82, 1214, 143], [140, 1217, 86], [166, 1208, 16], [146, 1200, -54], [75, 1197, -108],
    [0, 1198, -86],
];
#[rustfmt::skip]
pub(super) const CROTCH: [Figure; 1] = [
    [0, 821, 14],
];
#[rustfmt::skip]
pub(super) const CHEST: [Figure; 7] = [
    [0, 1328, 115], [95, 1333, 144], [158, 1353, 78], [191, 1331, -19], [173, 1329, -91], [83, 1321, -136],
    [0, 1321, -111],
];
/// The arm grows out at the side, so this ring has no side point.
#[rustfmt::skip]
pub(super) const BREAST: [Figure; 6] = [
    [0, 1392, 107], [92, 1397, 102], [181, 1421, 64], [174, 1423, -93], [79, 1410, -138], [0, 1407, -101],
];
#[rustfmt::skip]
pub(super) const SHOULDERS: [Figure; 7] = [
    [0, 1454, 75], [84, 1458, 55], [171, 1484, 38], [172, 1514, -10], [154, 1494, -67], [75, 1504, -88],
    [0, 1491, -82],
];
#[rustfmt::skip]
pub(super) const NECK: [Figure; 7] = [
    [0, 1496, 66], [36, 1483, 46], [69, 1482, 23], [70, 1508, -2], [59, 1528, -30], [29, 1538, -45],
    [0, 1541, -49],
];
#[rustfmt::skip]
pub(super) const JAW: [Figure; 7] = [
    [0, 1569, 100], [30, 1535, 60], [64, 1491, 35], [65, 1534, 12], [58, 1554, -16], [36, 1560, -42],
    [0, 1561, -51],
];
#[rustfmt::skip]
pub(super) const CHIN: [Figure; 7] = [
    [0, 1566, 139], [9, 1559, 92], [41, 1570, 46], [60, 1577, 26], [59, 1583, -4], [38, 1587, -35],
    [0, 1588, -55],
];
#[rustfmt::skip]
pub(super) const MOUTH: [Figure; 7] = [
    [0, 1591, 135], [24, 1558, 129], [54, 1579, 95], [74, 1621, 40], [64, 1613, -6], [39, 1611, -47],
    [0, 1611, -64],
];
#[rustfmt::skip]
pub(super) const LIP: [Figure; 7] = [
    [0, 1651, 134], [16, 1636, 119], [53, 1623, 117], [76, 1632, 40], [70, 1632, -17], [45, 1633, -66],
    [0, 1633, -79],
];
#[rustfmt::skip]
pub(super) const NOSE: [Figure; 7] = [
    [0, 1650, 184], [19, 1663, 101], [57, 1654, 111], [77, 1655, 42], [81, 1657, -22], [51, 1659, -74],
    [0, 1660, -90],
];
#[rustfmt::skip]
pub(super) const EYES: [Figure; 7] = [
    [0, 1691, 119], [4, 1695, 90], [48, 1664, 112], [83, 1684, 33], [83, 1692, -34], [50, 1695, -83],
    [0, 1695, -97],
];
#[rustfmt::skip]
pub(super) const BROW: [Figure; 7] = [
    [0, 1716, 116], [40, 1699, 130], [69, 1727, 83], [83, 1730, 18], [80, 1734, -33], [50, 1736, -74],
    [0, 1736, -87],
];
#[rustfmt::skip]
pub(super) const CROWN: [Figure; 7] = [
    [0, 1797, 73], [8, 1795, 76], [40, 1780, 44], [53, 1775, 13], [50, 1777, -20], [27, 1784, -49],
    [0, 1787, -64],
];
/// Leg rings start front-medial and turn over front, outside, back to the inside.
#[rustfmt::skip]
pub(super) const THIGH_TOP: [Figure; 8] = [
    [13, 766, 100], [100, 772, 144], [164, 777, 114], [190, 779, 36], [168, 781, -39], [96, 788, -72],
    [12, 793, -44], [-10, 782, 34],
];
#[rustfmt::skip]
pub(super) const THIGH: [Figure; 8] = [
    [36, 645, 77], [94, 644, 112], [149, 647, 88], [169, 648, 30], [152, 652, -30], [93, 659, -71],
    [28, 663, -43], [7, 656, 20],
];
#[rustfmt::skip]
pub(super) const ABOVE_KNEE: [Figure; 8] = [
    [40, 537, 62], [90, 531, 94], [128, 533, 60], [146, 535, 17], [138, 540, -26], [97, 546, -50],
    [38, 549, -37], [15, 545, 8],
];
#[rustfmt::skip]
pub(super) const BELOW_KNEE: [Figure; 8] = [
    [66, 439, 24], [98, 432, 49], [133, 430, 42], [158, 434, 3], [159, 441, -58], [101, 449, -83],
    [50, 452, -45], [42, 448, -5],
];
#[rustfmt::skip]
pub(super) const CALF: [Figure; 8] = [
    [61, 316, -2], [104, 307, 24], [149, 305, 15], [168, 312, -31], [154, 322, -81], [104, 332, -99],
    [54, 334, -83], [35, 327, -40],
];
#[rustfmt::skip]
pub(super) const ANKLE: [Figure; 8] = [
    [71, 121, -14], [96, 111, 2], [115, 111, -13], [122, 119, -28], [115, 127, -46], [93, 135, -68],
    [77, 136, -50], [73, 130, -33],
];
/// Arm rings start below and turn over front, top and back.
#[rustfmt::skip]
pub(super) const DELTOID: [Figure; 8] = [
    [232, 1367, -30], [226, 1401, 15], [236, 1433, 39], [245, 1480, 25], [246, 1500, -18], [241, 1475, -65],
    [234, 1434, -82], [235, 1378, -63],
];
#[rustfmt::skip]
pub(super) const UPPER_ARM: [Figure; 8] = [
    [322, 1380, -32], [319, 1401, 6], [324, 1428, 28], [327, 1463, 8], [330, 1480, -30], [329, 1466, -67],
    [325, 1429, -85], [324, 1385, -71],
];
#[rustfmt::skip]
pub(super) const ABOVE_ELBOW: [Figure; 8] = [
    [407, 1392, -30], [409, 1404, 5], [412, 1436, 18], [413, 1474, 3], [413, 1488, -29], [411, 1467, -57],
    [407, 1438, -75], [406, 1406, -62],
];
#[rustfmt::skip]
pub(super) const BELOW_ELBOW: [Figure; 8] = [
    [489, 1384, -38], [495, 1404, -4], [499, 1441, 2], [499, 1484, 2], [494, 1500, -32], [490, 1475, -63],
    [486, 1445, -84], [486, 1407, -73],
];
#[rustfmt::skip]
pub(super) const FOREARM: [Figure; 8] = [
    [591, 1399, -49], [596, 1414, -23], [602, 1440, -10], [601, 1470, -15], [596, 1484, -43],
    [591, 1472, -73], [588, 1444, -86], [588, 1411, -79],
];
#[rustfmt::skip]
pub(super) const WRIST: [Figure; 8] = [
    [705, 1420, -51], [708, 1422, -36], [717, 1440, -25], [717, 1460, -27], [713, 1471, -42],
    [708, 1467, -64], [705, 1444, -75], [703, 1422, -66],
];
#[rustfmt::skip]
pub(super) const PALM: [Figure; 8] = [
    [766, 1420, -54], [775, 1412, -22], [785, 1426, 4], [782, 1450, -15], [774, 1463, -47],
    [771, 1455, -68], [768, 1430, -98], [766, 1411, -69],
];
#[rustfmt::skip]
pub(super) const KNUCKLES: [Figure; 8] = [
    [801, 1429, -57], [806, 1425, -34], [810, 1440, -3], [808, 1458, -31], [802, 1456, -55],
    [803, 1448, -80], [789, 1430, -106], [797, 1423, -82],
];
/// The ends of the fingers and the thumb.
#[rustfmt::skip]
pub(super) const INDEX: [Figure; 3] = [
    [919, 1421, -29], [920, 1434, -6], [920, 1444, -28],
];
#[rustfmt::skip]
pub(super) const MIDDLE: [Figure; 4] = [
    [923, 1430, -72], [925, 1429, -54], [926, 1445, -53], [924, 1444, -71],
];
#[rustfmt::skip]
pub(super) const RING: [Figure; 4] = [
    [904, 1428, -98], [902, 1429, -83], [903, 1443, -83], [904, 1443, -98],
];
#[rustfmt::skip]
pub(super) const LITTLE: [Figure; 3] = [
    [864, 1419, -118], [864, 1436, -118], [864, 1427, -137],
];
#[rustfmt::skip]
pub(super) const THUMB: [Figure; 6] = [
    [831, 1422, 52], [834, 1423, 48], [836, 1413, 46], [827, 1402, 48], [821, 1403, 53], [824, 1414, 53],
];
/// The foot: its heel ring, the middle of the sole, two rings forward.
#[rustfmt::skip]
pub(super) const HEEL: [Figure; 8] = [
    [65, 8, -14], [106, 12, -7], [145, 3, -19], [145, 4, -44], [123, 7, -81], [99, 10, -98], [77, 9, -85],
    [65, 6, -45],
];
#[rustfmt::skip]
pub(super) const SOLE: [Figure; 1] = [
    [104, 8, -53],
];
#[rustfmt::skip]
pub(super) const INSTEP: [Figure; 6] = [
    [72, 52, 62], [104, 54, 62], [148, 38, 48], [172, 2, 47], [124, 7, 61], [69, 2, 63],
];
#[rustfmt::skip]
pub(super) const TOES: [Figure; 6] = [
    [58, 19, 166], [101, 17, 186], [164, 18, 137], [170, 1, 137], [107, -1, 187], [59, -3, 166],
];
