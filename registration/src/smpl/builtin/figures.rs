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
    [0, 850, 180], [103, 951, 97], [151, 905, 107], [207, 907, 29], [151, 882, -92], [66, 867, -140],
    [0, 874, -111],
];
#[rustfmt::skip]
pub(super) const HIPS: [Figure; 7] = [
    [0, 958, 148], [58, 977, 143], [134, 998, 96], [194, 984, 40], [151, 975, -82], [85, 991, -126],
    [0, 985, -128],
];
#[rustfmt::skip]
pub(super) const WAIST: [Figure; 7] = [
    [0, 1112, 185], [58, 1072, 195], [140, 1088, 96], [161, 1112, 39], [164, 1084, -44], [59, 1050, -83],
    [0, 1097, -54],
];
#[rustfmt::skip]
pub(super) const RIBS: [Figure; 7] = [
    [0, 1243, 157], [95, 1255, 122], [151, 1209, 66], [170, 1211, 25], [133, 1199, -74], [42, 1209, -114],
    [0, 1230, -89],
];
#[rustfmt::skip]
pub(super) const CROTCH: [Figure; 1] = [
    [0, 854, 15],
];
#[rustfmt::skip]
pub(super) const CHEST: [Figure; 7] = [
    [0, 1339, 98], [88, 1301, 168], [162, 1364, 86], [175, 1311, -37], [201, 1348, -72], [93, 1337, -143],
    [0, 1329, -109],
];
/// The arm grows out at the side, so this ring has no side point.
#[rustfmt::skip]
pub(super) const BREAST: [Figure; 6] = [
    [0, 1426, 98], [69, 1405, 98], [178, 1408, 62], [182, 1437, -91], [60, 1406, -142], [0, 1413, -92],
];
#[rustfmt::skip]
pub(super) const SHOULDERS: [Figure; 7] = [
    [0, 1482, 53], [75, 1446, 60], [169, 1463, 60], [169, 1530, 22], [161, 1483, -70], [54, 1510, -86],
    [0, 1498, -81],
];
#[rustfmt::skip]
pub(super) const NECK: [Figure; 7] = [
    [0, 1569, 100], [42, 1506, 20], [76, 1467, 15], [69, 1492, -17], [56, 1536, -42], [38, 1531, -40],
    [0, 1541, -52],
];
#[rustfmt::skip]
pub(super) const JAW: [Figure; 7] = [
    [0, 1572, 152], [11, 1569, 98], [37, 1574, 54], [61, 1573, 28], [57, 1555, -4], [31, 1573, -44],
    [0, 1577, -49],
];
#[rustfmt::skip]
pub(super) const MOUTH: [Figure; 7] = [
    [0, 1598, 122], [17, 1548, 137], [63, 1580, 87], [71, 1623, 29], [63, 1612, -11], [30, 1601, -44],
    [0, 1604, -57],
];
#[rustfmt::skip]
pub(super) const NOSE: [Figure; 7] = [
    [0, 1688, 156], [21, 1664, 110], [59, 1651, 117], [78, 1618, 35], [62, 1619, -13], [46, 1628, -62],
    [0, 1633, -81],
];
#[rustfmt::skip]
pub(super) const EYES: [Figure; 7] = [
    [0, 1676, 130], [2, 1689, 87], [61, 1657, 104], [79, 1676, 20], [89, 1669, -23], [53, 1682, -84],
    [0, 1681, -97],
];
#[rustfmt::skip]
pub(super) const BROW: [Figure; 7] = [
    [0, 1729, 107], [26, 1708, 134], [60, 1741, 98], [91, 1733, -5], [72, 1737, -44], [53, 1743, -69],
    [0, 1729, -96],
];
#[rustfmt::skip]
pub(super) const CROWN: [Figure; 7] = [
    [0, 1784, 83], [-3, 1803, 62], [36, 1787, 37], [57, 1767, -1], [55, 1771, -14], [29, 1779, -50],
    [0, 1801, -46],
];
/// Leg rings start front-medial and turn over front, outside, back to the inside.
#[rustfmt::skip]
pub(super) const THIGH_TOP: [Figure; 8] = [
    [-3, 757, 86], [104, 823, 161], [149, 783, 119], [193, 773, 44], [167, 793, -49], [79, 809, -65],
    [50, 842, -68], [-13, 768, -24],
];
#[rustfmt::skip]
pub(super) const THIGH: [Figure; 8] = [
    [27, 648, 77], [80, 661, 105], [147, 663, 106], [176, 657, 40], [138, 653, -52], [78, 686, -73],
    [44, 661, -46], [19, 627, -7],
];
#[rustfmt::skip]
pub(super) const ABOVE_KNEE: [Figure; 8] = [
    [38, 517, 61], [108, 491, 102], [146, 568, 28], [136, 551, 30], [160, 518, -6], [91, 548, -52],
    [47, 539, -36], [12, 514, -20],
];
#[rustfmt::skip]
pub(super) const BELOW_KNEE: [Figure; 8] = [
    [49, 441, 6], [122, 431, 54], [144, 454, 14], [141, 447, 31], [160, 449, -58], [98, 454, -83],
    [53, 457, -29], [57, 444, -31],
];
#[rustfmt::skip]
pub(super) const CALF: [Figure; 8] = [
    [21, 334, -12], [117, 337, 39], [141, 341, 24], [165, 345, 6], [174, 357, -75], [90, 355, -106],
    [49, 363, -81], [41, 365, -65],
];
#[rustfmt::skip]
pub(super) const SHIN: [Figure; 8] = [
    [81, 167, -9], [108, 187, 11], [136, 215, -5], [143, 216, -31], [129, 206, -75], [79, 229, -71],
    [59, 252, -41], [64, 221, -54],
];
#[rustfmt::skip]
pub(super) const ANKLE: [Figure; 8] = [
    [51, 61, -12], [78, 112, 15], [112, 77, 1], [129, 87, -34], [102, 70, -54], [89, 87, -80],
    [83, 87, -64], [88, 80, -67],
];
/// Arm rings start below and turn over front, top and back.
#[rustfmt::skip]
pub(super) const DELTOID: [Figure; 8] = [
    [257, 1380, -30], [198, 1395, 16], [249, 1412, 30], [255, 1475, 29], [252, 1497, -28], [249, 1470, -75],
    [233, 1411, -85], [242, 1376, -53],
];
#[rustfmt::skip]
pub(super) const UPPER_ARM: [Figure; 8] = [
    [324, 1376, -33], [330, 1408, 12], [321, 1438, 32], [310, 1472, 0], [326, 1479, -33], [330, 1469, -63],
    [317, 1427, -85], [311, 1380, -73],
];
#[rustfmt::skip]
pub(super) const ABOVE_ELBOW: [Figure; 8] = [
    [410, 1393, -34], [406, 1408, 17], [400, 1459, 18], [406, 1479, -10], [411, 1483, -38],
    [422, 1463, -64], [399, 1430, -74], [394, 1408, -59],
];
#[rustfmt::skip]
pub(super) const BELOW_ELBOW: [Figure; 8] = [
    [489, 1384, -30], [478, 1404, -5], [483, 1429, 1], [488, 1478, 9], [489, 1507, -16], [500, 1483, -56],
    [481, 1442, -86], [488, 1402, -66],
];
#[rustfmt::skip]
pub(super) const FOREARM: [Figure; 8] = [
    [595, 1393, -36], [604, 1458, 9], [649, 1504, -26], [625, 1406, -4], [596, 1487, -21], [564, 1476, -76],
    [581, 1449, -85], [603, 1409, -87],
];
#[rustfmt::skip]
pub(super) const WRIST: [Figure; 8] = [
    [700, 1419, -15], [723, 1487, -17], [756, 1448, -173], [713, 1394, -41], [692, 1471, 2],
    [688, 1470, -68], [703, 1451, -63], [720, 1432, -76],
];
#[rustfmt::skip]
pub(super) const PALM: [Figure; 8] = [
    [721, 1419, -43], [735, 1386, -4], [794, 1436, -6], [744, 1444, 10], [756, 1465, -25], [751, 1465, -73],
    [753, 1417, -97], [752, 1404, -65],
];
#[rustfmt::skip]
pub(super) const KNUCKLES: [Figure; 8] = [
    [802, 1430, -53], [814, 1430, -39], [842, 1433, -6], [786, 1463, -25], [802, 1459, -61],
    [774, 1449, -73], [811, 1431, -107], [799, 1422, -77],
];
/// The ends of the fingers and the thumb.
#[rustfmt::skip]
pub(super) const INDEX: [Figure; 3] = [
    [913, 1407, -17], [928, 1449, 0], [902, 1441, -49],
];
#[rustfmt::skip]
pub(super) const MIDDLE: [Figure; 4] = [
    [932, 1421, -50], [941, 1457, -46], [909, 1442, -83], [913, 1423, -72],
];
#[rustfmt::skip]
pub(super) const RING: [Figure; 4] = [
    [905, 1449, -103], [910, 1423, -114], [906, 1417, -74], [899, 1455, -78],
];
#[rustfmt::skip]
pub(super) const LITTLE: [Figure; 3] = [
    [875, 1416, -120], [861, 1447, -112], [864, 1422, -150],
];
#[rustfmt::skip]
pub(super) const THUMB: [Figure; 6] = [
    [813, 1396, 62], [810, 1432, 40], [846, 1422, 25], [819, 1409, 46], [845, 1416, 66], [848, 1411, 83],
];
/// The foot: its heel ring, the middle of the sole, two rings forward.
#[rustfmt::skip]
pub(super) const HEEL: [Figure; 8] = [
    [76, 17, 17], [107, 13, 14], [158, 5, -8], [146, 14, -17], [142, 18, -74], [114, 22, -101],
    [70, 14, -80], [63, 0, -49],
];
#[rustfmt::skip]
pub(super) const SOLE: [Figure; 1] = [
    [107, 2, -62],
];
#[rustfmt::skip]
pub(super) const INSTEP: [Figure; 6] = [
    [83, 56, 72], [110, 54, 78], [152, 35, 71], [203, 3, 137], [117, -2, 64], [60, 16, 64],
];
#[rustfmt::skip]
pub(super) const TOES: [Figure; 6] = [
    [57, 35, 119], [64, 11, 186], [104, 20, 158], [88, 7, 218], [87, 1, 164], [68, -9, 90],
];
